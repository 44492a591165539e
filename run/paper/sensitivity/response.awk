# A triaxial test as a row of response.csv: Z after packing, solid fraction at the start, the peak, and the plateau, the mean over axial
# strains of 25 to 36 %.
#   awk -v name=case -v header=1 -f response.awk report/summary.csv report/fig10.csv

BEGIN {
    FS = ","
    of_plateau = split("q_over_p volumetric_strain a_c coordination", on_plateau, " ")
    of_peak = split("axial_strain q_over_p volumetric_strain a_c a_n a_t coordination", at_peak, " ")
    if (header) {
        printf "method,erosion_ratio,stiffness_n_per_m,seed,packing_coordination,packing_unbalanced,start_solid_fraction"
        for (i = 1; i <= of_peak; i++) printf ",peak_%s", at_peak[i]
        for (i = 1; i <= of_plateau; i++) printf ",plateau_%s", on_plateau[i]
        print ""
    }
}

FNR == 1 {
    for (i = 1; i <= NF; i++) at[$i] = i
    next
}

NR == FNR {
    if ($at["state"] == "packing") { z = $at["coordination"]; rest = $at["unbalanced_force_ratio"] }
    if ($at["state"] == "consolidation") solid = $at["solid_fraction"]
    if ($at["state"] == "peak") for (i = 1; i <= of_peak; i++) peak[i] = $at[at_peak[i]]
    next
}

$at["axial_strain"] >= 0.25 && $at["axial_strain"] <= 0.36 {
    rows++
    for (i = 1; i <= of_plateau; i++) sum[i] += $at[on_plateau[i]]
}

END {
    if (!rows) { print name ": not compressed to 25 %" >"/dev/stderr"; exit 1 }
    printf "%s,%.5g,%.3g,%.5g", name, z, rest, solid
    for (i = 1; i <= of_peak; i++) printf ",%.5g", peak[i]
    for (i = 1; i <= of_plateau; i++) printf ",%.5g", sum[i] / rows
    print ""
}

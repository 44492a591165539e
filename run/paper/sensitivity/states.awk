# States of a triaxial test and its plateau, the mean over axial strains of 25 to 36 %: rows of gravity.csv and rate.csv.
#   awk -v name=on -f states.awk report/summary.csv report/fig10.csv

BEGIN {
    FS = ","
    columns = split("axial_strain volumetric_strain p_pa q_over_p coordination share_below_0_3_mean solid_fraction", wanted, " ")
}

FNR == 1 {
    for (i = 1; i <= NF; i++) at[$i] = i
    next
}

NR == FNR {
    printf "%s,%s", name, $2
    for (c = 1; c <= columns; c++) printf $at[wanted[c]] == "" ? "," : ",%.4g", $at[wanted[c]]
    print ""
    next
}

$at["axial_strain"] >= 0.25 && $at["axial_strain"] <= 0.36 {
    rows++
    for (c = 1; c <= columns; c++) sum[c] += $at[wanted[c]]
}

END {
    printf "%s,plateau", name
    for (c = 1; c <= columns; c++) printf ",%.4g", sum[c] / rows
    print ""
}

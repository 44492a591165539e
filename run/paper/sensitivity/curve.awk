# Strains and stress ratio of a triaxial test: rows of rate_curves.csv.
#   awk -v rate=10 -f curve.awk report/fig10.csv

BEGIN { FS = OFS = "," }

FNR == 1 {
    for (i = 1; i <= NF; i++) at[$i] = i
    next
}

{ print rate, $at["axial_strain"], $at["q_over_p"], $at["volumetric_strain"] }

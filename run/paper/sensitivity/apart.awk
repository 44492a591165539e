# How far curves of two triaxial tests are apart: the root mean square of the difference at the strains of the first,
# by linear interpolation in the second, and over the largest value (q/p) or the range (volumetric strain) of that.
#   awk -f apart.awk one/report/fig10.csv other/report/fig10.csv

BEGIN { FS = "," }

FNR == 1 {
    for (i = 1; i <= NF; i++) at[$i] = i
    file++
    next
}

{
    n[file]++
    strain[file, n[file]] = $at["axial_strain"]
    value["q_over_p", file, n[file]] = $at["q_over_p"]
    value["volumetric_strain", file, n[file]] = $at["volumetric_strain"]
}

function compare(name, from_zero,    i, k, x, y, low, high, squares, count) {
    k = 1
    low = from_zero ? 0 : value[name, 2, 1]
    high = value[name, 2, 1]
    for (i = 1; i <= n[2]; i++) {
        if (value[name, 2, i] < low) low = value[name, 2, i]
        if (value[name, 2, i] > high) high = value[name, 2, i]
    }
    for (i = 1; i <= n[1]; i++) {
        x = strain[1, i]
        if (x < strain[2, 1] || x > strain[2, n[2]]) continue
        while (k < n[2] - 1 && strain[2, k + 1] < x) k++
        y = value[name, 2, k] + (value[name, 2, k + 1] - value[name, 2, k]) * (x - strain[2, k]) / (strain[2, k + 1] - strain[2, k])
        squares += (value[name, 1, i] - y) ^ 2
        count++
    }
    printf "%s,%.4g,%.4g\n", name, sqrt(squares / count), sqrt(squares / count) / (high - low)
}

END {
    print "curve,rms_difference,share"
    compare("q_over_p", 1)
    compare("volumetric_strain", 0)
}

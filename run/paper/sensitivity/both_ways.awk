# What two methods say of the same pairs, as the end of a row of erosion.csv; appends a histogram of the true overlaps
# of all eroded contacts, over the mean eroded overlap, to the file `histogram`, each row headed by `name`.
#   paste -d, <(cut -d, -f 1,2 true.csv) <(cut -d, -f 2 eroded.csv) |
#       awk -v particles=600 -v name=case -v histogram=overlaps.csv -f both_ways.awk

BEGIN { FS = "," }

NR > 1 {
    touch += $2 > 0
    lost += $2 > 0 && $3 <= 0
    if ($3 > 0) {
        truth[++eroded] = $2
        spurious += $2 <= 0
        sum += $3
        excess += $3 - $2
    }
}

END {
    printf ",%d,%d,%d,%d,%.5g,%.5g\n", touch, eroded, lost, spurious, 2 * touch / particles, excess / sum
    mean = sum / eroded
    for (i = 1; i <= eroded; i++) count[int(5 * truth[i] / mean + 100) - 100]++
    for (k = -10; k < 20; k++) printf "%s,%.1f,%d\n", name, k / 5, count[k] >>histogram
}

# Z of contacts between particles and the mean resultant force over the mean contact force, over time, from the history of a packing:
# rows of rest_N.csv, ten times as far apart as those of the history; and for the file `ends` a row of what holds over the last
# quarter of the steps since all grains are there.
#   awk -v name=case -v grains=600 -v ends=rest_600_ends.csv -f rest.awk history.csv

BEGIN { FS = OFS = "," }

FNR == 1 {
    for (i = 1; i <= NF; i++) at[$i] = i
    split("step time_s particles contacts unbalanced", wanted, " ")
    for (i in wanted) if (!(wanted[i] in at)) { print "no column " wanted[i] >"/dev/stderr"; failed = 1; exit 1 }
    next
}

$at["particles"] > 0 {
    n++
    step[n] = $at["step"]
    z[n] = 2 * $at["contacts"] / $at["particles"]
    if (!full && $at["particles"] == grains) full = step[n]
    force[n] = $at["unbalanced"]
    if (n % 10 == 1) printf "%s,%d,%.5g,%.5g,%.4g\n", name, step[n], $at["time_s"], z[n], force[n]
}

END {
    if (failed) exit 1
    if (!full) { print name ": not all grains have fallen" >"/dev/stderr"; exit 1 }
    least = most = z[n]
    for (i = n; i >= 1 && step[i] >= full + 0.75 * (step[n] - full); i--) {
        count++
        sum += z[i]; squares += z[i] * z[i]; forces += force[i]
        if (z[i] < least) least = z[i]
        if (z[i] > most) most = z[i]
    }
    mean = sum / count
    variance = count > 1 ? (squares - count * mean * mean) / (count - 1) : 0
    deviation = variance > 0 ? sqrt(variance) : 0
    printf "%s,%d,%.5g,%.5g,%.2g,%.5g,%.5g,%.4g,%.4g\n", name, step[n], z[n], mean, deviation, least, most, force[n], forces / count >>ends
}

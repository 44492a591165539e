# Means and standard deviations of columns over the rows with the same keys, in the order in which these first appear.
# Nothing, if one of the rows has no value.
#   awk -v keys="aspect_ratio friction" -v values="solid_fraction coordination" -f mean.awk table.csv

BEGIN {
    FS = OFS = ","
    n_keys = split(keys, key, " ")
    n_values = split(values, value, " ")
}

FNR == 1 {
    for (i = 1; i <= NF; i++) at[$i] = i
    next
}

{
    name = $at[key[1]]
    for (i = 2; i <= n_keys; i++) name = name "," $at[key[i]]
    if (!(name in count)) order[++rows] = name
    count[name]++
    for (i = 1; i <= n_values; i++) {
        x = $at[value[i]]
        if (x == "") without[name, i] = 1
        sum[name, i] += x
        squares[name, i] += x * x
    }
}

END {
    line = key[1]
    for (i = 2; i <= n_keys; i++) line = line "," key[i]
    line = line ",packings"
    for (i = 1; i <= n_values; i++) line = line "," value[i] "," value[i] "_deviation"
    print line
    for (r = 1; r <= rows; r++) {
        name = order[r]
        n = count[name]
        line = name "," n
        for (i = 1; i <= n_values; i++) {
            if ((name, i) in without) {
                line = line ",,"
                continue
            }
            mean = sum[name, i] / n
            variance = n > 1 ? (squares[name, i] - n * mean * mean) / (n - 1) : 0
            line = line sprintf(",%.5g,%.2g", mean, variance > 0 ? sqrt(variance) : 0)
        }
        print line
    }
}

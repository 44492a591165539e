# A table as SVG: column y over column x, one line for each value of column `by`, y from low to high. x is
# logarithmic with a mark at each point, and a line to the standard deviation on either side if there is a column
# y_deviation; with -v curve=0.05 it is linear, without marks, and numbered at multiples of that.
#   awk -v x=aspect_ratio -v y=coordination -v by=friction -v low=4 -v high=11 -f plot.awk table.csv > plot.svg

BEGIN {
    FS = ","
    width = 560; height = 360; left = 70; right = 540; top = 36; bottom = 310
    split("#0072B2 #E69F00 #009E73 #D55E00", colour, " ")
}

NR == 1 {
    for (i = 1; i <= NF; i++) column[$i] = i
    next
}

{
    if (!($column[by] in group)) { group[$column[by]] = ++groups; name[groups] = $column[by] }
    g = group[$column[by]]
    n[g]++
    xs[g, n[g]] = $column[x]
    ys[g, n[g]] = $column[y]
    if ((y "_deviation") in column) deviation[g, n[g]] = $column[y "_deviation"]
    if (first == "" || $column[x] < first) first = $column[x]
    if ($column[x] > last) last = $column[x]
}

function share(value) { return curve ? (value - first) / (last - first) : log(value / first) / log(last / first) }
function across(value) { return left + 12 + (right - left - 24) * share(value) }
function up(value) { return bottom - (bottom - top) * (value - low) / (high - low) }
function words(text, at_x, at_y, anchor) {
    printf "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">%s</text>\n", at_x, at_y, anchor, text
}
function line(x1, y1, x2, y2, stroke) {
    printf "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"%s\"/>\n", x1, y1, x2, y2, stroke
}

END {
    printf "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#1F2933\">\n", width, height
    printf "<rect width=\"%d\" height=\"%d\" fill=\"white\"/>\n", width, height
    for (k = 0; k <= 5; k++) {
        value = low + k * (high - low) / 5
        line(left, up(value), right, up(value), "#E3E7EB")
        words(sprintf("%.4g", value), left - 8, up(value) + 4, "end")
    }
    ticks = curve ? 1 + int(last / curve) : n[1]
    for (i = 1; i <= ticks; i++) {
        value = curve ? (i - 1) * curve : xs[1, i]
        line(across(value), bottom, across(value), bottom + 5, "#5B6672")
        words(value, across(value), bottom + 19, "middle")
    }
    line(left, bottom, right, bottom, "#5B6672")
    gsub(/_/, " ", x); gsub(/_/, " ", y); gsub(/_/, " ", by)
    words(x, (left + right) / 2, height - 8, "middle")
    printf "<text transform=\"translate(20 %d) rotate(-90)\" text-anchor=\"middle\">%s</text>\n", (top + bottom) / 2, y
    for (g = 1; g <= groups; g++) {
        printf "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"1.5\" points=\"", colour[g]
        for (i = 1; i <= n[g]; i++) printf "%.1f,%.1f ", across(xs[g, i]), up(ys[g, i])
        print "\"/>"
        for (i = 1; i <= n[g]; i++) if (deviation[g, i] > 0)
            line(across(xs[g, i]), up(ys[g, i] - deviation[g, i]), across(xs[g, i]), up(ys[g, i] + deviation[g, i]), colour[g])
        for (i = 1; i <= n[g] && !curve; i++) printf "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\" fill=\"%s\"/>\n", across(xs[g, i]), up(ys[g, i]), colour[g]
        printf "<rect x=\"%d\" y=\"14\" width=\"10\" height=\"10\" fill=\"%s\"/>\n", left + 130 * (g - 1), colour[g]
        words(by " " name[g], left + 130 * (g - 1) + 15, 23, "start")
    }
    print "</svg>"
}

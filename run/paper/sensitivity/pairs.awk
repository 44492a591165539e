# A LAMMPS dump of dem-post, periodic along x and y (with -v walls=1: not periodic), as pairs for dem-contact: those
# whose bounding spheres touch, B at the image nearest to A, A at the origin.
#   awk [-v walls=1] -f pairs.awk particles.dump > pairs.csv

/^ITEM: BOX BOUNDS/ { side = 1; next }
/^ITEM: ATOMS/ { side = 0; atoms = 1; next }
side { period[side++] = walls ? 1e99 : $2 - $1 }
atoms {
    n++
    id[n] = $1
    x[n] = $3; y[n] = $4; z[n] = $5
    attitude[n] = $9 "," $6 "," $7 "," $8
    axes[n] = sprintf("%.17g,%.17g,%.17g", $10 / 2, $11 / 2, $12 / 2)
    radius[n] = $10 > $11 ? $10 / 2 : $11 / 2
}

function nearest(distance, length_) {
    return distance > length_ / 2 ? distance - length_ : distance < -length_ / 2 ? distance + length_ : distance
}

END {
    print "id,aA,bA,cA,aB,bB,cB,xA,yA,zA,qwA,qxA,qyA,qzA,xB,yB,zB,qwB,qxB,qyB,qzB"
    for (i = 1; i <= n; i++) {
        for (j = i + 1; j <= n; j++) {
            dx = nearest(x[j] - x[i], period[1])
            dy = nearest(y[j] - y[i], period[2])
            dz = z[j] - z[i]
            if (dx * dx + dy * dy + dz * dz < (radius[i] + radius[j]) ^ 2) {
                printf "%s-%s,%s,%s,0,0,0,%s,%.17g,%.17g,%.17g,%s\n", id[i], id[j], axes[i], axes[j], attitude[i], dx, dy, dz, attitude[j]
            }
        }
    }
}

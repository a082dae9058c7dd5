# Maps of a scan as one picture:  gnuplot -e "maps='DIR'; picture='FILE.png'" plots/maps.gp
# Draws trace_NAME.gsf of DIR and, where there are such, truth_NAME.gsf below in the same colours.

header(file, key) = real(system(sprintf("LC_ALL=C awk -F ' = ' '$1 == \"%s\" {printf \"%%.15f\", $2; exit}' '%s'", key, file)))
size(file) = int(system(sprintf("stat -c %%s '%s'", file)))
present(file) = int(system(sprintf("test -e '%s' && echo 1 || echo 0", file)))
path(side, name) = sprintf("%s/%s_%s.gsf", maps, side, name)

array names[4] = ["topography_nm", "contact_strength_gpa_sqrt_nm", "adhesion_nn", "contact_distance_nm"]
array titles[4] = ["height (nm)", "contact strength (GPa nm^{1/2})", "adhesion (nN)", "contact distance (nm)"]
array shown_per_stored[4] = [1e9, 1.0, 1e9, 1e9]
array low[4]
array high[4]

rows = present(path("truth", names[1])) ? 2 : 1
set terminal pngcairo size 1500, 60 + 330*rows font "sans,11"
set encoding utf8
set output picture
set multiplot layout rows, 4 margins 0.03, 0.95, (rows == 2 ? 0.06 : 0.10), (rows == 2 ? 0.93 : 0.88) spacing 0.08, 0.13
set palette cubehelix start 0.5 cycles -1.2 saturation 1
unset key
set size ratio -1
set object 1 rectangle from graph 0,0 to graph 1,1 behind fillcolor rgb "grey70" fillstyle solid noborder  # not fitted
set tics out nomirror scale 0.5
set xlabel "µm" offset 0,0.7

do for [row = 1:rows] {
  do for [k = 1:4] {
    file = path(row == 1 ? "trace" : "truth", names[k])
    columns = int(header(file, "XRes"))
    lines = int(header(file, "YRes"))
    data = size(file) - 4*columns*lines
    width = header(file, "XReal") > 0 ? 1e6*header(file, "XReal")/columns : 1.0
    height = header(file, "YReal") > 0 ? 1e6*header(file, "YReal")/lines : 1.0
    if (row == 1) {
      # Single pixels at the edges of grains lie far outside: colours span the quartiles and as much again on both sides.
      stats file binary skip=data record=(columns*lines) format='%float32' using ($1*shown_per_stored[k]) name "M" nooutput
      reach = 1.5*(M_up_quartile - M_lo_quartile)
      low[k] = M_min > M_lo_quartile - reach ? M_min : M_lo_quartile - reach
      high[k] = M_max < M_up_quartile + reach ? M_max : M_up_quartile + reach
    }
    lowest = low[k]
    highest = high[k]
    set cbrange [lowest:highest]
    set title titles[k].(rows == 1 ? "" : row == 1 ? ", fitted" : ", truth")
    plot [0:columns*width] [0:lines*height] file binary skip=data array=(columns, lines) dx=width dy=height flip=y \
      origin=(0.5*width, 0.5*height) format='%float32' using ($1*shown_per_stored[k]) with image
  }
}
unset multiplot

# Figure 3: force curves with the parameters of 100 noisy fits, and the true one.
set terminal svg size 1000,450 font "sans,14" background rgb "white"
set output "force_curves.svg"
hertz = "force_curves_hertz_2tone_equal_energy.dat"
dmt = "force_curves_dmt_4tone_equal_energy.dat"
set multiplot
set key off
do for [panel in "1 2"] {
  file = panel eq "1" ? hertz : dmt
  stats file skip 1 nooutput
  columns = int(STATS_columns)
  set origin panel eq "1" ? 0.0 : 0.5, 0.0
  set size 0.5, 1.0
  set title panel eq "1" ? "(a) Hertz, 2 tones, equal energy" : "(b) DMT, 4 tones, equal energy"
  set xlabel "d (nm)"
  set ylabel "F (nN)"
  set xrange [*:-35]
  set yrange [*:*]
  set xtics auto
  set ytics auto
  plot for [i=3:columns] file using 1:i with lines lc rgb "#8ec7e8", \
       file using 1:2 with lines dt 2 lw 2 lc rgb "black"
  set origin panel eq "1" ? 0.22 : 0.72, 0.36
  set size 0.26, 0.48
  unset title
  unset xlabel
  unset ylabel
  set xrange [-41.5:-38.5]
  set yrange [panel eq "1" ? -0.6 : -6.5 : panel eq "1" ? 2.4 : -1.5]
  set xtics 1
  set ytics 1
  plot for [i=3:columns] file using 1:i with lines lc rgb "#8ec7e8", \
       file using 1:2 with lines dt 2 lw 2 lc rgb "black"
}
unset multiplot

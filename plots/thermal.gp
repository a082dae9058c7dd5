# A thermal spectrum, its fit and the residuals:  gnuplot -e "table='FILE'; picture='FILE.png'" plots/thermal.gp
# FILE is what `combforce calibrate thermal --table FILE` writes: one block a fit, here side by side.

stats table using 1:2 nooutput
blocks = STATS_blocks
width = blocks == 1 ? 1000 : 520*blocks
set terminal pngcairo size width, 700 font "sans,12"
set encoding utf8
set output picture

set multiplot
set tics out nomirror
set grid lc rgb "grey85"
share = 1.0/blocks
do for [b = 0:blocks - 1] {
  set autoscale
  stats table using ($1/1e3):2 index b nooutput
  set xrange [STATS_min_x:STATS_max_x]
  set xtics autofreq
  set lmargin at screen b*share + 100.0/width
  set rmargin at screen (b + 1)*share - 25.0/width

  set tmargin at screen 0.94
  set bmargin at screen 0.40
  set logscale y
  set format y "10^{%T}"
  set format x ""
  unset xlabel
  if (b == 0) { set ylabel "power density (V²/Hz)" offset 1; set key at screen 0.5, 0.975 center horizontal } else { unset ylabel; unset key }
  plot table using ($1/1e3):2 index b with points pt 7 ps 0.4 lc rgb "grey50" title "measured", \
       table using ($1/1e3):3 index b with lines lw 2 lc rgb "#c0392b" title "oscillator and floor"

  set tmargin at screen 0.37
  set bmargin at screen 0.10
  unset logscale y
  set format y "%g"
  set format x "%g"
  set xlabel "frequency (kHz)"
  if (b == 0) { set ylabel "measured/fit − 1" }
  unset key
  plot table using ($1/1e3):4:5 index b with yerrorbars pt 7 ps 0.4 lc rgb "grey50", \
       0 with lines lw 2 lc rgb "#c0392b"
}
unset multiplot

# A thermal spectrum, its fit and the residuals:  gnuplot -e "table='FILE'; picture='FILE.png'" plots/thermal.gp
# FILE is what `combforce calibrate thermal --table FILE` writes: one block a fit.

set terminal pngcairo size 1000, 700 font "sans,12"
set encoding utf8
set output picture
stats table using 1:2 nooutput
blocks = STATS_blocks
low = STATS_min_x/1e3
high = STATS_max_x/1e3
wide = high > 20*(low > 0 ? low : high/1e3)

set multiplot layout 2, 1
set lmargin 12
set rmargin 3
set tics out nomirror
set grid lc rgb "grey85"
if (wide) { set logscale x; set xrange [*:high] } else { set xrange [low:high] }

set tmargin 2
set bmargin 0
set size 1, 0.62
set origin 0, 0.38
set logscale y
set format y "10^{%T}"
set format x ""
set ylabel "power density (V²/Hz)"
set key top right
plot for [b = 0:blocks - 1] table using ($1/1e3):2 index b with points pt 7 ps 0.4 lc rgb "grey50" \
       title (b == 0 ? "measured" : ""), \
     for [b = 0:blocks - 1] table using ($1/1e3):3 index b with lines lw 2 lc rgb "#c0392b" \
       title (b == 0 ? "oscillator and floor" : "")

set tmargin 1
set bmargin 4
set size 1, 0.38
set origin 0, 0
unset logscale y
set format y "%g"
set format x "%g"
set xlabel "frequency (kHz)"
set ylabel "measured/fit − 1"
unset key
plot for [b = 0:blocks - 1] table using ($1/1e3):4:5 index b with yerrorbars pt 7 ps 0.4 lc rgb "grey50", \
     0 with lines lw 2 lc rgb "#c0392b"
unset multiplot

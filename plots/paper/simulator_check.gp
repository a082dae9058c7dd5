# Figure 5: the force recovered from the whole spectrum (equation 7) against the force the simulator used.
set terminal pngcairo size 1000,450 font "sans,12"
set output "simulator_check.png"
file = "simulator_check_dmt_4tone_equal_energy.dat"
set multiplot layout 1,2
set xlabel "d (nm)"
set xrange [*:-35]
set ylabel "F (nN)"
set key top right
plot file using 1:2 with points pt 7 ps 0.3 lc rgb "#1f77b4" title "recovered", \
     file using 1:3 smooth unique with lines dt 2 lw 2 lc rgb "black" title "used"
set ylabel "recovered - used (pN)"
set key top left Left reverse samplen 0.5 font ",10"
plot file using 1:4 with points pt 7 ps 0.15 lc rgb "#1f77b4" title "spectrum to 100 MHz", \
     file using 1:5 with points pt 7 ps 0.15 lc rgb "#d62728" title "both forces below 100 MHz"
unset multiplot

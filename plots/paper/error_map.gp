# Figure 2: the error over (p0, p1) of the Hertz model, the starts that fail, and the minima with noise.
set terminal svg size 1000,470 font "sans,14" background rgb "white"
set output "error_map.svg"
set multiplot layout 1,2
set label 1 "start fails" at -49.5,2.85 front
set xlabel "p_0 (nm)"
set ylabel "p_1 (GPa nm^{1/2})"
set cblabel "log_{10} E / nN^2"
set palette defined (0 "#440154", 0.25 "#3b528b", 0.5 "#21918c", 0.75 "#5ec962", 1 "#fde725")
set xrange [-50:-30]
set yrange [0.025:3.025]
set arrow 1 from -40, graph 0 to -40, graph 1 nohead dt 2 lc rgb "white" front
set arrow 2 from graph 0, first 1 to graph 1, first 1 nohead dt 2 lc rgb "white" front
do for [scheme in "equal_energy equal_amplitude"] {
  map = "error_map_hertz_2tone_".scheme.".dat"
  minima = "minima_hertz_2tone_".scheme.".dat"
  set title scheme eq "equal_energy" ? "(a) equal energy" : "(b) equal amplitude"
  plot map using 1:2:(log10($3)) with image notitle, \
       map using ($4 == 0 ? $1 : NaN):2:(0.125):(0.025) with boxxyerror fs solid noborder lc rgb "gray60" notitle, \
       minima using 1:2 every ::1 with points pt 6 ps 0.5 lc rgb "white" notitle, \
       minima using 1:2 every ::0::0 with points pt 2 ps 1.2 lw 2 lc rgb "white" notitle
}
unset multiplot

# Figure 2: the error over (p0, p1) of the Hertz model, the starts from which the paper's fit fails, and the minima with
# noise.
set terminal svg size 1000,470 font "sans,14" background rgb "white"
set output "error_map.svg"
set multiplot layout 1,2
set xlabel "p_0 (nm)"
set ylabel "p_1 (GPa nm^{1/2})"
set cblabel "log_{10} E / nN^2"
set palette defined (0 "#440154", 0.25 "#3b528b", 0.5 "#21918c", 0.75 "#5ec962", 1 "#fde725")
set xrange [-50:-30]
set yrange [0.025:3.025]
set arrow 1 from -40, graph 0 to -40, graph 1 nohead dt 2 lc rgb "white" front
set arrow 2 from graph 0, first 1 to graph 1, first 1 nohead dt 2 lc rgb "white" front
set key outside below horizontal samplen 1 font ",11"
do for [scheme in "equal_energy equal_amplitude"] {
  map = "error_map_hertz_2tone_".scheme.".dat"
  starts = "starts_hertz_2tone_".scheme.".dat"
  minima = "minima_hertz_2tone_".scheme.".dat"
  set title scheme eq "equal_energy" ? "(a) equal energy" : "(b) equal amplitude"
  plot map using 1:2:(log10($3)) with image notitle, \
       starts using ($3 == 0 ? $1 : NaN):2:(0.25):(0.05) with boxxyerror fs solid noborder lc rgb "gray60" \
         title "start fails", \
       minima using 1:2 every ::1 with points pt 6 ps 0.5 lc rgb "gray85" title "with noise", \
       minima using 1:2 every ::0::0 with points pt 2 ps 1.5 lw 3 lc rgb "red" title "without"
}
unset multiplot

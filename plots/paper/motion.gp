# Figure 4: motion of each mode and of the tip, and their spectra with the linear responses.
set terminal svg size 1000,1100 font "sans,13" background rgb "white"
set output "motion.svg"
set multiplot layout 5,2 margins 0.09,0.98,0.05,0.98 spacing 0.1,0.03
motion = "motion_dmt_4tone_equal_energy.dat"
spectra = "spectra_dmt_4tone_equal_energy.dat"
names = "q_1 q_2 q_3 q_4 d"
set key top right
do for [i=1:5] {
  set format x i == 5 ? "%g" : ""
  unset logscale y
  set format y "%g"
  set xrange [0:15]
  set yrange [*:*]
  set xlabel i == 5 ? "t (µs)" : ""
  set ylabel word(names, i)." (nm)"
  plot motion using 1:i+1 with lines lc rgb "#1f77b4" notitle
  set logscale y
  set format y "10^{%T}"
  set xrange [0:4000]
  set yrange [1e-6:200]
  set xlabel i == 5 ? "f (kHz)" : ""
  set ylabel "|".word(names, i)."| (nm)"
  plot spectra using 1:i+1 with impulses lc rgb "#1f77b4" notitle, \
       spectra using 1:i+6 with lines dt 2 lc rgb "gray50" title i == 5 ? "|χ| (nm/nN)" : "|χ_".i."| (nm/nN)"
}
unset multiplot

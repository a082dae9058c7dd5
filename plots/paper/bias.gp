# How far each parameter of the paper's cases lies from the truth: by the paper's method, refined, and what thermal noise
# allows at least. Hertz 2 EE: two tones of equal energy; EA: of equal amplitude. p0 as a share of
# 1 nm, the others of their value.
set terminal svg size 900,400 font "sans,14" background rgb "white"
set output "bias.svg"
set style data histograms
set style histogram clustered gap 1
set style fill solid noborder
set logscale y
set format y "10^{%L}"
set yrange [1e-7:10]
set ylabel "distance from the truth\n(p_0: nm; others: of the value)"
set xtics rotate by -40 font ",11" scale 0
set key outside above horizontal
set grid ytics
plot "bias.dat" using 2:xtic(1) lc rgb "#d95f02" title "the paper's method", \
     "" using 3 lc rgb "#1b9e77" title "refined", \
     "" using 4 lc rgb "gray70" title "standard error that noise allows (2 ms, 300 K)"

// The inner loops of the comb extractor, compiled for every SIMD target and chosen at run time.
//
// A chunk is `chunk_vectors` vectors of `lanes` successive samples. Lane l of every vector is a decimated
// stream of its own, so all lanes of a step share one coefficient (a broadcast, hence a table of 2 floats a
// step whatever the vector's width) and the lanes' phases are applied once, after the last chunk. The chunk
// is folded about its centre first: cosine is even and sine odd, which halves the products. With
// x_v the v-th vector of a chunk, h = chunk_vectors/2 and a_j = 2 pi b lanes (j + 1/2) / N,
//     S = sum_{j<h} (x_{h+j} + x_{h-1-j}) cos a_j  -  i sum_{j<h} (x_{h+j} - x_{h-1-j}) sin a_j
// is the chunk's sum referred to its centre, a complex number a lane.
//
// Rounding of S, worst case over any input of magnitude <= A, in units of u = 2^-24, as error of the phasor:
// runs of 8 fused steps in single precision 9, three additions of four runs 4.5, table 1, fold 2 (f32 only;
// exact for i16): 16.5 u A < 1e-6 A. Targets without FMA round each product too (2) and take runs of
// 4 steps (5): 14.5 u A. A longer run, or more of them, would break the promise of 1e-6.
#pragma once

#include <cstddef>
#include <cstdint>

namespace combforce {

struct ChunkStatistics {
  double sum;       // of the samples; exact for i16
  double min, max;  // NaN samples may be skipped or spread
};

struct CombKernels {
  std::size_t lanes;
  std::size_t chunk_vectors;

  // Folds one chunk (lanes * chunk_vectors samples) into as many floats: for each j the `lanes` sums, then
  // the `lanes` differences. `folded` is aligned to a vector.
  ChunkStatistics (*fold_i16)(const std::int16_t* samples, float* folded);
  ChunkStatistics (*fold_f32)(const float* samples, float* folded);

  // For every tone t and each of `chunks` (1 or 2) successive folded chunks: state_t = state_t w_t + S_t
  // (Horner's rule: the state is referred to the centre of the newest chunk).
  //   coefficients: [tones][chunk_vectors/2][cos, -sin];
  //   advance:      [tones][re, im] of w_t = exp(+i 2 pi b_t lanes chunk_vectors / N);
  //   state:        [tones][re, im][lanes], aligned to a vector.
  void (*accumulate)(const float* folded, std::size_t chunks, std::size_t tones, const float* coefficients,
                     const double* advance, double* state);
};

// Chosen for the CPU it runs on: the same CPU type gives the same bits.
CombKernels comb_kernels();

}  // namespace combforce

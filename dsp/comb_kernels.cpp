#include "dsp/comb_kernels.hpp"

#include <algorithm>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "dsp/comb_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes first: it includes this file once a target.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace combforce::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using F32 = hn::ScalableTag<float>;
using F64 = hn::ScalableTag<double>;
using Narrow = hn::Rebind<float, F64>;  // as many floats as a vector of doubles takes
using I32 = hn::Rebind<std::int32_t, F32>;
using I16 = hn::Rebind<std::int16_t, F32>;
using I16Wide = hn::ScalableTag<std::int16_t>;
using VecF32 = hn::Vec<F32>;
using VecF64 = hn::Vec<F64>;

constexpr std::size_t runs = 4;
constexpr std::size_t steps_per_run = HWY_NATIVE_FMA ? 8 : 4;
constexpr std::size_t folds = runs * steps_per_run;
constexpr std::size_t chunk_vectors = 2 * folds;

// Two chunks by four tones want 16 accumulators, 4 samples and 2 coefficients: more than 16 registers hold.
constexpr std::size_t tile_tones = HWY_TARGET <= HWY_AVX3 ? 4 : 2;

// Least and greatest of a chunk. Highway reduces no i16 vectors on x86: the last step goes through memory.
struct Extremes {
  std::int16_t min, max;
};
Extremes extremes_of(const std::int16_t* HWY_RESTRICT samples) {
  const I16Wide wide;
  const std::size_t step = hn::Lanes(wide);
  const std::size_t count = chunk_vectors * hn::Lanes(F32());
  auto min = hn::LoadU(wide, samples);
  auto max = min;
  for (std::size_t i = step; i < count; i += step) {
    const auto x = hn::LoadU(wide, samples + i);
    min = hn::Min(x, min);
    max = hn::Max(x, max);
  }
  HWY_ALIGN std::int16_t mins[hn::MaxLanes(I16Wide())];
  HWY_ALIGN std::int16_t maxs[hn::MaxLanes(I16Wide())];
  hn::Store(min, wide, mins);
  hn::Store(max, wide, maxs);
  return {*std::min_element(mins, mins + step), *std::max_element(maxs, maxs + step)};
}

ChunkStatistics fold_i16(const std::int16_t* HWY_RESTRICT samples, float* HWY_RESTRICT folded) {
  const F32 f32;
  const I32 i32;
  const I16 i16;
  const std::size_t lanes = hn::Lanes(f32);
  auto sum = hn::Zero(i32);
  for (std::size_t j = 0; j < folds; ++j) {
    const auto later = hn::PromoteTo(i32, hn::LoadU(i16, samples + (folds + j) * lanes));
    const auto earlier = hn::PromoteTo(i32, hn::LoadU(i16, samples + (folds - 1 - j) * lanes));
    const auto plus = hn::Add(later, earlier);
    sum = hn::Add(sum, plus);
    hn::Store(hn::ConvertTo(f32, plus), f32, folded + 2 * j * lanes);
    hn::Store(hn::ConvertTo(f32, hn::Sub(later, earlier)), f32, folded + (2 * j + 1) * lanes);
  }
  const Extremes extremes = extremes_of(samples);
  return {static_cast<double>(hn::GetLane(hn::SumOfLanes(i32, sum))), static_cast<double>(extremes.min),
          static_cast<double>(extremes.max)};
}

ChunkStatistics fold_f32(const float* HWY_RESTRICT samples, float* HWY_RESTRICT folded) {
  const F32 f32;
  const F64 f64;
  const Narrow narrow;
  const std::size_t lanes = hn::Lanes(f32);
  auto sum = hn::Zero(f64);
  auto min = hn::Set(f32, std::numeric_limits<float>::infinity());
  auto max = hn::Neg(min);
  for (std::size_t j = 0; j < folds; ++j) {
    const auto later = hn::LoadU(f32, samples + (folds + j) * lanes);
    const auto earlier = hn::LoadU(f32, samples + (folds - 1 - j) * lanes);
    float* const plus = folded + 2 * j * lanes;
    hn::Store(hn::Add(later, earlier), f32, plus);
    hn::Store(hn::Sub(later, earlier), f32, plus + lanes);
    for (std::size_t l = 0; l < lanes; l += hn::Lanes(f64))
      sum = hn::Add(sum, hn::PromoteTo(f64, hn::Load(narrow, plus + l)));
    min = hn::Min(later, hn::Min(earlier, min));
    max = hn::Max(later, hn::Max(earlier, max));
  }
  return {hn::GetLane(hn::SumOfLanes(f64, sum)), static_cast<double>(hn::GetLane(hn::MinOfLanes(f32, min))),
          static_cast<double>(hn::GetLane(hn::MaxOfLanes(f32, max)))};
}

// state = state w + sum, chunk by chunk, for one tone. sums: [chunks][re, im][lanes].
template <std::size_t C>
HWY_INLINE void advance_state(const float* HWY_RESTRICT sums, const double* HWY_RESTRICT advance,
                              double* HWY_RESTRICT state) {
  const F64 f64;
  const Narrow narrow;
  const std::size_t lanes = hn::Lanes(F32());
  const VecF64 w_re = hn::Set(f64, advance[0]);
  const VecF64 w_im = hn::Set(f64, advance[1]);
  for (std::size_t l = 0; l < lanes; l += hn::Lanes(f64)) {
    VecF64 re = hn::Load(f64, state + l);
    VecF64 im = hn::Load(f64, state + lanes + l);
    for (std::size_t c = 0; c < C; ++c) {
      const VecF64 sum_re = hn::PromoteTo(f64, hn::Load(narrow, sums + 2 * c * lanes + l));
      const VecF64 sum_im = hn::PromoteTo(f64, hn::Load(narrow, sums + (2 * c + 1) * lanes + l));
      const VecF64 next_re = hn::NegMulAdd(im, w_im, hn::MulAdd(re, w_re, sum_re));
      im = hn::MulAdd(im, w_re, hn::MulAdd(re, w_im, sum_im));
      re = next_re;
    }
    hn::Store(re, f64, state + l);
    hn::Store(im, f64, state + lanes + l);
  }
}

// One tile: T tones by C chunks, the sums of a run in registers.
template <std::size_t T, std::size_t C>
void accumulate_tile(const float* HWY_RESTRICT folded, const float* HWY_RESTRICT coefficients,
                     const double* HWY_RESTRICT advance, double* HWY_RESTRICT state) {
  const F32 f32;
  const std::size_t lanes = hn::Lanes(f32);
  HWY_ALIGN float total[T * C * 2 * hn::MaxLanes(F32())] = {};
  HWY_UNROLL(1)
  for (std::size_t run = 0; run < runs; ++run) {
    VecF32 sum[T][C][2];
    for (std::size_t t = 0; t < T; ++t)
      for (std::size_t c = 0; c < C; ++c) sum[t][c][0] = sum[t][c][1] = hn::Zero(f32);
    HWY_UNROLL(1)
    for (std::size_t j = run * steps_per_run; j < (run + 1) * steps_per_run; ++j) {
      VecF32 plus[C], minus[C];
      for (std::size_t c = 0; c < C; ++c) {
        plus[c] = hn::Load(f32, folded + (c * chunk_vectors + 2 * j) * lanes);
        minus[c] = hn::Load(f32, folded + (c * chunk_vectors + 2 * j + 1) * lanes);
      }
      for (std::size_t t = 0; t < T; ++t) {
        const VecF32 cosine = hn::Set(f32, coefficients[(t * folds + j) * 2]);
        const VecF32 sine = hn::Set(f32, coefficients[(t * folds + j) * 2 + 1]);
        for (std::size_t c = 0; c < C; ++c) {
          sum[t][c][0] = hn::MulAdd(plus[c], cosine, sum[t][c][0]);
          sum[t][c][1] = hn::MulAdd(minus[c], sine, sum[t][c][1]);
        }
      }
    }
    for (std::size_t t = 0; t < T; ++t)
      for (std::size_t c = 0; c < C; ++c)
        for (std::size_t part = 0; part < 2; ++part) {
          float* const place = total + ((t * C + c) * 2 + part) * lanes;
          hn::Store(hn::Add(hn::Load(f32, place), sum[t][c][part]), f32, place);
        }
  }
  for (std::size_t t = 0; t < T; ++t)
    advance_state<C>(total + t * C * 2 * lanes, advance + 2 * t, state + 2 * t * lanes);
}

template <std::size_t C>
void accumulate_tones(const float* folded, std::size_t tones, const float* coefficients,
                      const double* advance, double* state) {
  const std::size_t lanes = hn::Lanes(F32());
  std::size_t t = 0;
  for (; t + tile_tones <= tones; t += tile_tones)
    accumulate_tile<tile_tones, C>(folded, coefficients + t * chunk_vectors, advance + 2 * t,
                                   state + 2 * t * lanes);
  for (; t < tones; ++t)
    accumulate_tile<1, C>(folded, coefficients + t * chunk_vectors, advance + 2 * t, state + 2 * t * lanes);
}

void accumulate(const float* folded, std::size_t chunks, std::size_t tones, const float* coefficients,
                const double* advance, double* state) {
  if (chunks == 2)
    accumulate_tones<2>(folded, tones, coefficients, advance, state);
  else
    accumulate_tones<1>(folded, tones, coefficients, advance, state);
}

CombKernels kernels() {
  return {hn::Lanes(F32()), chunk_vectors, fold_i16, fold_f32, accumulate};
}

}  // namespace combforce::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace combforce {

HWY_EXPORT(kernels);

CombKernels comb_kernels() {
  return HWY_DYNAMIC_DISPATCH(kernels)();
}

}  // namespace combforce
#endif

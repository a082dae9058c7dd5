// The list of tip-surface force models. A model is one header (hertz.hpp, dmt.hpp) with its formula templated
// on the scalar, plus one entry in model_list.hpp.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <string_view>

namespace combforce {

struct ParameterInfo {
  std::string_view name;  // with its unit: the key in messages, for example "adhesion_nn"
  double lower, upper;    // default bounds of a fit
  double scale;           // typical size: the solver works on parameter/scale
};

struct ModelInfo {
  std::string_view name;     // "hertz"
  std::string_view formula;  // for people
  std::string_view source;   // equation in the paper, or reference
  std::span<const ParameterInfo> parameters;
};

// One function of d that a fit integrates: a term phi_k of F = sum p_k phi_k, or its derivative with respect
// to a nonlinear parameter or to the tip's velocity.
struct ModelTerm {
  std::size_t linear;      // k, or unit_coefficient
  std::size_t derivative;  // index of that parameter, or one of these
};
// Of a model without linear parameters: F is phi.
inline constexpr std::size_t unit_coefficient = std::numeric_limits<std::size_t>::max();
inline constexpr std::size_t value_of_term = std::numeric_limits<std::size_t>::max();
inline constexpr std::size_t velocity_of_term = value_of_term - 1;

// What a term is multiplied by.
inline double coefficient(const double* p, const ModelTerm& term) {
  return term.linear == unit_coefficient ? 1.0 : p[term.linear];
}

// Models whose force depends on the tip's velocity (nm/s), in contact alone.
template <typename Model>
concept DependsOnVelocity = requires(const double* p) {
  Model::contact(p, 0.0, 0.0);
};

// Models whose force has a pole at the surface: the tip stays above it.
template <typename Model>
concept StaysAboveSurface = requires {
  Model::least_height_nm;
};

// Models whose force depends on the tip's history: contact forms where d falls through p0, and lasts until d
// rises through p0 + release_height_nm(). They are fitted to the partial motion alone, and not simulated.
template <typename Model>
concept DependsOnHistory = requires(const double* p) {
  Model::release_height_nm(p);
};

// Models whose one linear parameter p_k sets the scale of another one: F = p_k phi(d; p_ratio/p_k, others).
template <typename Model>
concept HasRatio = requires {
  Model::ratio;
};

// Models whose force decays exponentially from 1 nN at p0, by e over the length that is parameter `decay`.
template <typename Model>
concept Decays = requires {
  Model::decay;
};

// Models that are a polynomial in d, F = sum p_k d^(k+1): without a surface, and without terms, since a fit
// needs no search.
template <typename Model>
concept IsPolynomial = requires {
  Model::powers(0.0);
};
template <typename Model>
concept NeedsSearch = !IsPolynomial<Model>;

// `engaged`: the tip has been in contact, and not been released since; it is where d < p0 whatever this says.
template <typename Model, typename T>
T force_of(const T* p, const T& d, double velocity_nm_per_s, [[maybe_unused]] bool engaged = false) {
  if constexpr (DependsOnVelocity<Model>)
    return Model::force(p, d, velocity_nm_per_s);
  else if constexpr (DependsOnHistory<Model>)
    return Model::force(p, d, engaged);
  else
    return Model::force(p, d);
}

template <typename Model>
auto contact_of(const double* p, double depth, double velocity_nm_per_s) {
  if constexpr (DependsOnVelocity<Model>)
    return Model::contact(p, depth, velocity_nm_per_s);
  else
    return Model::contact(p, depth);
}

// The deflection up to which a model's contact, or what is left of it, may last.
template <typename Model>
double contact_top_nm(const double* p) {
  if constexpr (DependsOnHistory<Model>)
    return p[0] + Model::release_height_nm(p);
  else
    return p[0];
}

// Where F or its derivatives may jump: p[0], or for a polynomial below everything; for a force with a pole,
// where its wall begins.
template <typename Model>
double surface_nm(const double* p) {
  if constexpr (IsPolynomial<Model>)
    return -std::numeric_limits<double>::infinity();
  else if constexpr (StaysAboveSurface<Model>)
    return p[0] + Model::wall_height_nm(p);
  else
    return p[0];
}

// All models, in a fixed order.
std::span<const ModelInfo> force_models();

// The model called `name`. Throws std::invalid_argument that lists the names there are.
const ModelInfo& find_model(std::string_view name);

// Whether it is one that DependsOnHistory.
bool depends_on_history(const ModelInfo& model);

// Why a model is fitted to the partial motion alone, and not simulated: "its force …"; empty for the others.
std::string_view why_partial_fit_only(const ModelInfo& model);

// Force at tip deflection d (nm) with velocity d_dot (nm/s), nN, for plots and simulation; `parameters` in
// the model's order. Where the force depends on history: of a tip on its way in, or `engaged`, out of
// contact. Dispatches once a call: hot loops use the model's own header.
double model_force(const ModelInfo& model, std::span<const double> parameters, double d_nm,
                   double velocity_nm_per_s = 0.0, bool engaged = false);

}  // namespace combforce

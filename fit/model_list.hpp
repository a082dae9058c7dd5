// The list of force models as types: hot loops are compiled for each, and dispatched once.
#pragma once

#include <tuple>
#include <utility>

#include "fit/capillary.hpp"
#include "fit/cone.hpp"
#include "fit/dlvo.hpp"
#include "fit/dmt.hpp"
#include "fit/exponential.hpp"
#include "fit/flat_punch.hpp"
#include "fit/force_model.hpp"
#include "fit/hertz.hpp"
#include "fit/jkr.hpp"
#include "fit/kelvin_voigt.hpp"
#include "fit/lennard_jones.hpp"
#include "fit/polynomial.hpp"

namespace combforce {

// A new model is a header, its fitter (fitters/) and an entry here.
using ForceModels = std::tuple<Hertz, Dmt, Cone, FlatPunch, KelvinVoigt, LennardJones, Dlvo, Exponential, Jkr,
                               Capillary, Polynomial>;

// Calls function(Model{}) for the model that `info` describes, one of `Models`, and returns what it returns.
template <typename Models = ForceModels, std::size_t Index = 0, typename Function>
decltype(auto) visit_model(const ModelInfo& info, Function&& function) {
  using Model = std::tuple_element_t<Index, Models>;
  if constexpr (Index + 1 < std::tuple_size_v<Models>) {
    if (info.name != Model::model.name)
      return visit_model<Models, Index + 1>(info, std::forward<Function>(function));
  }
  return std::forward<Function>(function)(Model{});
}

}  // namespace combforce

// Everything the paper shows, computed: what report.hpp and figures.hpp present.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/cli/paper/error_map.hpp"
#include "daemon/cli/paper/force_curves.hpp"
#include "daemon/cli/paper/simulator_check.hpp"
#include "daemon/cli/paper/tables.hpp"

namespace combforce::paper {

struct Results {
  std::size_t draws = 0;                          // of the noise, a case
  std::vector<CaseMotion> motions;                // of all cases, in their order
  std::vector<TableRow> rows;                     // likewise
  std::vector<std::vector<std::string>> remarks;  // likewise
  std::vector<SimulatorCheck> checks;             // likewise
  BandCheck band;                                 // of motion_shown()'s case
  std::vector<ErrorMap> maps;                     // Hertz, 2 tones: EE, EA
  std::vector<ForceCurves> curves;                // Hertz, 2 tones, EE; DMT, 4 tones, EE
};

// All studies, on all cores, the ones with noise over `draws` (2 … all_draws) of it. `step` is told what is
// being done. The results do not depend on the number of cores. Throws std::invalid_argument naming value and
// bound.
Results reproduce(std::size_t draws, const std::function<void(std::string_view)>& step);

// Which case figure 4 shows.
const CaseMotion& motion_shown(const Results& results);

}  // namespace combforce::paper

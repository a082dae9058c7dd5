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
  std::vector<CaseMotion> motions;                // of all cases, in their order
  std::vector<TableRow> rows;                     // likewise
  std::vector<std::vector<std::string>> remarks;  // likewise
  std::vector<SimulatorCheck> checks;             // likewise
  SimulatorCheck check_at_double_rate;            // of motion_shown()'s case, at 400 MHz
  std::vector<ErrorMap> maps;                     // Hertz, 2 tones: EE, EA
  std::vector<ForceCurves> curves;                // Hertz, 2 tones, EE; DMT, 4 tones, EE
};

// All studies, on all cores. `step` is told what is being done. The results do not depend on the number of
// cores.
Results reproduce(const std::function<void(std::string_view)>& step);

// Which case figure 4 shows.
const CaseMotion& motion_shown(const Results& results);

}  // namespace combforce::paper

#include "daemon/cli/paper/results.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "daemon/cli/paper/remarks.hpp"
#include "daemon/cli/parallel.hpp"

namespace combforce::paper {
namespace {

constexpr std::string_view case_shown = "dmt_4tone_equal_energy";

std::size_t index(std::string_view key) {
  return static_cast<std::size_t>(&find_case(key) - cases().data());
}

std::vector<std::string> all_remarks(const CaseMotion& motion, const TableRow& row) {
  std::vector<std::string> remarks = noise_free_remarks(motion, row);
  for (std::string& remark : scatter_remarks(motion, row)) remarks.push_back(std::move(remark));
  return remarks;
}

}  // namespace

Results reproduce(std::size_t draws, const std::function<void(std::string_view)>& step) {
  if (draws < 2 || draws > all_draws)
    throw std::invalid_argument(fmt::format("draws: {}, must be 2 to {}", draws, all_draws));
  Results results;
  results.draws = draws;
  const std::size_t count = cases().size();
  results.motions.resize(count);
  results.checks.resize(count);
  results.remarks.resize(count);

  step("simulating 5 cases, and one at higher rates");
  parallel_for(count + 1, [&] {
    return [&](std::size_t i) {
      if (i == 0) {  // the longest, hence first
        results.band = check_band(find_case(case_shown));
        return;
      }
      results.motions[i - 1] = simulate(cases()[i - 1]);
      results.checks[i - 1] = check_simulator(results.motions[i - 1]);
    };
  });
  step("fitting, without noise and with");
  for (const CaseMotion& motion : results.motions) results.rows.push_back(fit_case(motion, draws));
  step("seeking the cause of differences");
  parallel_for(count, [&] {
    return [&](std::size_t i) { results.remarks[i] = all_remarks(results.motions[i], results.rows[i]); };
  });
  step("mapping the error");
  for (const std::size_t i : {index("hertz_2tone_equal_energy"), index("hertz_2tone_equal_amplitude")})
    results.maps.push_back(map_error(results.motions[i], results.rows[i].noise_free));
  for (const std::size_t i : {index("hertz_2tone_equal_energy"), index("dmt_4tone_equal_energy")})
    results.curves.push_back(force_curves(results.motions[i], results.rows[i]));
  return results;
}

const CaseMotion& motion_shown(const Results& results) {
  return results.motions[index(case_shown)];
}

}  // namespace combforce::paper

#include "daemon/cli/paper/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "proto/pixel_message.hpp"

namespace combforce::paper {
namespace {

std::string table_head(std::size_t parameters) {
  std::string names = "|  |", rule = "|---|";
  for (std::size_t k = 0; k < parameters; ++k) {
    names += fmt::format(" {} paper | ours |", parameter_heads[k]);
    rule += "---:|---:|";
  }
  return names + "\n" + rule + "\n";
}

std::string table_rows(const TableRow& row) {
  const Printed& printed = row.of->printed;
  std::string noise_free = fmt::format("| {} |", row.of->label), noisy = "| with noise |";
  for (std::size_t k = 0; k < row.of->truth.size(); ++k) {
    const Scatter& ours = row.least.scatter[k];
    noise_free += fmt::format(" {:.2f} | {:.4f} |", printed.noise_free[k], row.noise_free.parameters[k]);
    noisy += fmt::format(" {:.2f} ± {:.2f} | {:.2f} ± {:.2f} |", printed.mean[k], printed.spread[k],
                         ours.mean, ours.spread);
  }
  return noise_free + "\n" + noisy + "\n";
}

std::string table(const Results& results, std::string_view model, std::string_view title) {
  std::string text = fmt::format("## {}\n\n", title), remarks;
  bool begun = false;
  for (std::size_t i = 0; i < results.rows.size(); ++i) {
    const TableRow& row = results.rows[i];
    if (row.of->model != model) continue;
    if (!begun) {
      text += table_head(row.of->truth.size()) + "| True |";
      for (const double value : row.of->truth) text += fmt::format(" {0:.2f} | {0:.2f} |", value);
      text += "\n";
      begun = true;
    }
    text += table_rows(row);
    for (const std::string& remark : results.remarks[i]) remarks += fmt::format("- {}\n", remark);
  }
  return text + (remarks.empty() ? "" : "\n" + remarks) + "\n";
}

std::string status_text(const Draws& draws) {
  std::string text;
  for (const FitStatus status : {FitStatus::converged, FitStatus::ill_conditioned, FitStatus::ambiguous,
                                 FitStatus::at_bound, FitStatus::not_converged, FitStatus::no_contact}) {
    const auto count = std::ranges::count(draws.fits, status, &FitResult::status);
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, to_string(status));
  }
  return text;
}

std::string draws_line(std::string_view label, const Draws& draws) {
  std::string text = fmt::format("| {} | {} |", label, status_text(draws));
  for (std::size_t k = 0; k < parameter_heads.size(); ++k)
    text += k < draws.scatter.size() ? fmt::format(" {:.2f} ({:.2f} … {:.2f}) |", draws.scatter[k].median,
                                                   draws.scatter[k].lower, draws.scatter[k].upper)
                                     : "  |";
  return text + "\n";
}

std::string draws_text(const Results& results) {
  std::string text = fmt::format(
      "## The draws with noise\n\nOur fitter scans for the least E of all, and gives its status with the "
      "noise known: ill_conditioned where a standard error exceeds 30 %, ambiguous where another minimum "
      "fits as well, at_bound where E falls all the way to a bound of the model (DMT: a contact distance of "
      "{} nm, a well too narrow for the tones to show). A search from the true parameters stays in the "
      "minimum near them. Median (quantiles 0.16 … 0.84) of the draws that gave parameters, all but "
      "not_converged and no_contact: unlike mean and standard deviation they do not depend on the few "
      "farthest.\n\n| case | draws |",
      find_model("dmt").parameters[3].lower);
  for (const std::string_view column : parameter_heads) text += fmt::format(" {} |", column);
  text += "\n|---|---|---:|---:|---:|---:|\n";
  for (const TableRow& row : results.rows)
    text += draws_line(name(*row.of), row.least) + draws_line("— from the truth", row.from_truth);
  return text + "\n";
}

std::string starts_line(std::string_view label, const Starts& starts) {
  return fmt::format("| {} | {:.1f} % of {} | {:.2f} | {:.2f} |\n", label, 100.0 * starts.found_share,
                     starts.found.size(), starts.first_p0_nm, starts.last_p0_nm);
}

std::string map_text(const Results& results) {
  std::string text =
      "## Error map (figure 2)\n\nE over p0 and p1, Hertz, and where fits begun on the grid end in its "
      "minimum: the paper's (MINPACK on both parameters) and ours (p1 eliminated). Paper: fails only "
      "\"several nm away from the true value\".\n\n"
      "| case, fit | starts that find it | for every p1, from p0 (nm) | to |\n|---|---:|---:|---:|\n";
  for (const ErrorMap& map : results.maps)
    text += starts_line(name(*map.of) + ", the paper's", map.papers) + starts_line("— ours", map.ours);
  const ErrorMap& map = results.maps[0];
  return text + fmt::format("\nThe grid: p0 {:.2f} to {:.2f} nm, p1 {:.2f} to {:.2f} GPa nm^1/2.\n\n",
                            map.p0_nm.front(), map.p0_nm.back(), map.p1.front(), map.p1.back());
}

std::string curves_text(const Results& results) {
  std::string text =
      "## Force curves with noise (figure 3)\n\nFitted minus true force, from the deepest point reached to "
      "-35 nm. Paper: typically less than 1 nN (Hertz), within a few nN (DMT).\n\n"
      "| case | curves | rms (nN) | below 1 nN (% of points) | largest of a curve, median (nN) | of all (nN) "
      "|\n"
      "|---|---:|---:|---:|---:|---:|\n";
  for (const ForceCurves& curves : results.curves)
    text += fmt::format("| {} | {} | {:.2f} | {:.1f} | {:.2f} | {:.2f} |\n", name(*curves.of),
                        curves.fitted_nn.size(), curves.rms_nn, 100.0 * curves.share_below_1_nn,
                        curves.median_largest_nn, curves.largest_nn);
  return text + "\n";
}

// The cases whose differences round to the paper's 800 and 10 pN, one digit each.
std::string as_printed(const Results& results) {
  std::string names;
  for (const SimulatorCheck& check : results.checks)
    if (std::lround(10.0 * check.difference.largest_nn) == 8 &&
        std::lround(100.0 * check.difference.spread_nn) == 1)
      names += fmt::format("{}{}", names.empty() ? "" : "; ", name(*check.of));
  return names.empty() ? "of no case" : names;
}

std::string check_text(const Results& results) {
  std::string text =
      "## The simulator (figure 5)\n\nForce recovered by equation 7 from the whole spectrum of the last 2 ms "
      "at 200 MHz, against the force used. Paper: largest 800 pN, standard deviation 10 pN, for a case it "
      "does not name.\n\n"
      "| case | largest (pN) | standard deviation (pN) |\n|---|---:|---:|\n";
  for (const SimulatorCheck& check : results.checks)
    text += fmt::format("| {} | {:.0f} | {:.2f} |\n", name(*check.of), 1e3 * check.difference.largest_nn,
                        1e3 * check.difference.spread_nn);
  text += fmt::format("\nIn the digits printed, these are the paper's: {}.\n", as_printed(results));
  const BandCheck& band = results.band;
  text += fmt::format(
      "\nThe same motion sampled at higher rates, {}. The spectrum ends at half the rate, the force has a "
      "kink at the surface: the largest difference falls as the sample interval, the standard deviation as "
      "its power 3/2.\n\n"
      "| rate (MHz) | largest (pN) | standard deviation (pN) |\n|---:|---:|---:|\n",
      name(*band.of));
  for (const BandCheck::AtRate& rate : band.rates)
    text += fmt::format("| {:.0f} | {:.0f} | {:.2f} |\n", 1e-6 * rate.sample_rate_hz,
                        1e3 * rate.difference.largest_nn, 1e3 * rate.difference.spread_nn);
  return text +
         fmt::format(
             "| {:.0f}, both forces below 100 MHz | {:.2f} | {:.3f} |\n\n"
             "The last row bounds the simulator's own error: in the paper's test {:.2g} of the variance.\n\n",
             1e-6 * band.rates.back().sample_rate_hz, 1e3 * band.in_band.largest_nn,
             1e3 * band.in_band.spread_nn,
             std::pow(band.in_band.spread_nn / band.rates.front().difference.spread_nn, 2.0));
}

std::string motion_text(const Results& results) {
  const CaseMotion& motion = motion_shown(results);
  std::string text =
      fmt::format("## Motion (figure 4): {}\n\nPeak amplitudes, nm.\n\n|  | free |", name(*motion.of));
  for (std::size_t m = 0; m < motion.engaged.mode_nm.size(); ++m) text += fmt::format(" q{} |", m + 1);
  text += " d |\n|---|---:|";
  for (std::size_t m = 0; m <= motion.engaged.mode_nm.size(); ++m) text += "---:|";
  text += "\n";
  for (std::size_t i = 0; i < motion.of->bins.size(); ++i) {
    text +=
        fmt::format("| {:.0f} kHz | {:.4f} |", 1e-3 * delta_f_hz * static_cast<double>(motion.of->bins[i]),
                    std::abs(motion.free_nm[i]));
    for (const auto& mode : motion.engaged.mode_nm) text += fmt::format(" {:.4f} |", std::abs(mode[i]));
    text += fmt::format(" {:.4f} |\n", std::abs(motion.engaged.tip_nm[i]));
  }
  return text;
}

}  // namespace

std::string name(const Case& of) {
  return fmt::format("{}, {}", of.model == "dmt" ? "DMT" : "Hertz", of.label);
}

std::string markdown(const Results& results) {
  return "# Forchheimer, Borysov, Platz, Haviland 2014, from our own simulator and fitter\n\n"
         "20 ms simulated, the last 2 ms analysed; the paper's fit on the partial motion, its average over "
         "the window converged. With noise: mean ± standard deviation over " +
         fmt::format("{} draws of the paper's noise.\n\n", results.draws) +
         table(results, "hertz", "Hertz (table 2)") + table(results, "dmt", "DMT (table 3)") +
         draws_text(results) + map_text(results) + curves_text(results) + check_text(results) +
         motion_text(results);
}

}  // namespace combforce::paper

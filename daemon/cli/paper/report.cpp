#include "daemon/cli/paper/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "proto/pixel_message.hpp"

namespace combforce::paper {
namespace {

constexpr std::array<std::string_view, 4> columns{"p0 (nm)", "p1 (GPa nm^1/2)", "p2 (nN)", "p3 (nm)"};

std::string table_head(std::size_t parameters) {
  std::string names = "|  |", rule = "|---|";
  for (std::size_t k = 0; k < parameters; ++k) {
    names += fmt::format(" {} paper | ours |", columns[k]);
    rule += "---:|---:|";
  }
  return names + "\n" + rule + "\n";
}

std::string table_rows(const TableRow& row) {
  const Printed& printed = row.of->printed;
  std::string noise_free = fmt::format("| {} |", row.of->label), noisy = "| with noise |";
  for (std::size_t k = 0; k < row.of->truth.size(); ++k) {
    const Scatter& ours = row.scatter[k];
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

std::string name(const Case& of) {
  return fmt::format("{}, {}", of.model == "dmt" ? "DMT" : "Hertz", of.label);
}

std::string map_text(const Results& results) {
  std::string text =
      "## Error map (figure 2)\n\nE over p0 and p1, Hertz, and where a fit started on the grid ends in the "
      "minimum.\n\n"
      "| case | minimum p0, p1 | starts that find it | for every p1, from p0 (nm) | to "
      "|\n|---|---|---:|---:|---:|\n";
  for (const ErrorMap& map : results.maps) {
    const auto row = std::ranges::find(results.rows, map.of, &TableRow::of);
    text += fmt::format("| {} | {:.3f}, {:.4f} | {:.1f} % of {} | {:.2f} | {:.2f} |\n", name(*map.of),
                        row->noise_free.parameters[0], row->noise_free.parameters[1], 100.0 * map.found_share,
                        map.found.size(), map.first_p0_nm, map.last_p0_nm);
  }
  return text + fmt::format(
                    "\nThe grid: p0 {:.2f} to {:.2f} nm, p1 {:.2f} to {:.2f} GPa nm^1/2. Paper: fails only "
                    "\"several nm away from the true value\".\n\n",
                    results.maps[0].p0_nm.front(), results.maps[0].p0_nm.back(), results.maps[0].p1.front(),
                    results.maps[0].p1.back());
}

std::string curves_text(const Results& results) {
  std::string text =
      "## Force curves with noise (figure 3)\n\nFitted minus true force, from the deepest point reached to "
      "-35 nm. "
      "Paper: typically less than 1 nN (Hertz), within a few nN (DMT).\n\n"
      "| case | curves | rms (nN) | below 1 nN (% of points) | largest of a curve, median (nN) | of all (nN) "
      "|\n"
      "|---|---:|---:|---:|---:|---:|\n";
  for (const ForceCurves& curves : results.curves)
    text += fmt::format("| {} | {} | {:.2f} | {:.1f} | {:.2f} | {:.2f} |\n", name(*curves.of),
                        curves.fitted_nn.size(), curves.rms_nn, 100.0 * curves.share_below_1_nn,
                        curves.median_largest_nn, curves.largest_nn);
  return text + "\n";
}

std::string check_text(const Results& results) {
  std::string text =
      "## The simulator (figure 5)\n\nForce recovered by equation 7 from the whole spectrum of the last 2 ms "
      "at 200 MHz, "
      "against the force used. Paper: at most 800 pN, standard deviation 10 pN (it does not say for which "
      "case).\n\n"
      "| case | largest (pN) | standard deviation (pN) |\n|---|---:|---:|\n";
  for (const SimulatorCheck& check : results.checks)
    text += fmt::format("| {} | {:.0f} | {:.2f} |\n", name(*check.of), 1e3 * check.largest_nn,
                        1e3 * check.spread_nn);
  const SimulatorCheck& finer = results.check_at_double_rate;
  return text +
         fmt::format(
             "\n- {}, sampled at 400 MHz: {:.0f} and {:.2f} pN. What a higher rate removes is no error of "
             "the "
             "integrator but of the spectrum, which ends at half the rate while the force has a kink at the "
             "surface.\n\n",
             name(*finer.of), 1e3 * finer.largest_nn, 1e3 * finer.spread_nn);
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

Json parameters_json(const Case& of, std::span<const double> values) {
  Json object = Json::object();
  const ModelInfo& model = find_model(of.model);
  for (std::size_t k = 0; k < of.truth.size(); ++k)
    object[std::string(model.parameters[k].name)] = number9(values[k]);
  return object;
}

Json row_json(const TableRow& row, const std::vector<std::string>& remarks) {
  const Case& of = *row.of;
  std::vector<double> means, spreads;
  for (const Scatter& one : row.scatter) {
    means.push_back(one.mean);
    spreads.push_back(one.spread);
  }
  return {{"case", of.key},
          {"model", of.model},
          {"label", of.label},
          {"truth", parameters_json(of, of.truth)},
          {"paper",
           {{"noise_free", parameters_json(of, of.printed.noise_free)},
            {"mean", parameters_json(of, of.printed.mean)},
            {"standard_deviation", parameters_json(of, of.printed.spread)}}},
          {"ours",
           {{"status", to_string(row.noise_free.status)},
            {"noise_free", parameters_json(of, row.noise_free.parameters)},
            {"quadrature_errors", parameters_json(of, row.noise_free.quadrature_errors)},
            {"mean", parameters_json(of, means)},
            {"standard_deviation", parameters_json(of, spreads)},
            {"draws", row.noisy.size()},
            {"draws_with_parameters", row.valid}}},
          {"remarks", remarks}};
}

Json check_json(const SimulatorCheck& check) {
  return {{"case", check.of->key},
          {"largest_nn", number9(check.largest_nn)},
          {"standard_deviation_nn", number9(check.spread_nn)}};
}

Json motion_json(const CaseMotion& motion) {
  const auto amplitudes = [](const std::vector<std::complex<double>>& tones) {
    Json list = Json::array();
    for (const std::complex<double>& tone : tones) list.push_back(number9(std::abs(tone)));
    return list;
  };
  Json modes = Json::array();
  for (const auto& mode : motion.engaged.mode_nm) modes.push_back(amplitudes(mode));
  return {{"case", motion.of->key},
          {"bin", motion.of->bins},
          {"free_nm", amplitudes(motion.free_nm)},
          {"engaged_nm", amplitudes(motion.engaged.tip_nm)},
          {"mode_nm", modes}};
}

}  // namespace

std::string markdown(const Results& results) {
  return "# Forchheimer, Borysov, Platz, Haviland 2014, from our own simulator and fitter\n\n"
         "20 ms simulated, the last 2 ms analysed; the paper's fit on the partial motion, its average over "
         "the window "
         "converged. With noise: mean ± standard deviation over 100 draws of the paper's noise.\n\n" +
         table(results, "hertz", "Hertz (table 2)") + table(results, "dmt", "DMT (table 3)") +
         map_text(results) + curves_text(results) + check_text(results) + motion_text(results);
}

Json json(const Results& results) {
  Json tables = Json::array(), maps = Json::array(), curves = Json::array(), checks = Json::array();
  for (std::size_t i = 0; i < results.rows.size(); ++i)
    tables.push_back(row_json(results.rows[i], results.remarks[i]));
  for (const ErrorMap& map : results.maps)
    maps.push_back({{"case", map.of->key},
                    {"starts", map.found.size()},
                    {"share_found", number9(map.found_share)},
                    {"all_found_from_p0_nm", number9(map.first_p0_nm)},
                    {"all_found_to_p0_nm", number9(map.last_p0_nm)}});
  for (const ForceCurves& one : results.curves)
    curves.push_back({{"case", one.of->key},
                      {"curves", one.fitted_nn.size()},
                      {"rms_nn", number9(one.rms_nn)},
                      {"share_below_1_nn", number9(one.share_below_1_nn)},
                      {"median_largest_nn", number9(one.median_largest_nn)},
                      {"largest_nn", number9(one.largest_nn)}});
  for (const SimulatorCheck& check : results.checks) checks.push_back(check_json(check));
  return {{"conditions",
           {{"sample_rate_hz", sample_rate_hz},
            {"delta_f_hz", delta_f_hz},
            {"temperature_k", temperature_k},
            {"draws", draws},
            {"seed", seed}}},
          {"tables", tables},
          {"error_maps", maps},
          {"force_curves", curves},
          {"simulator_check", checks},
          {"simulator_check_400_mhz", check_json(results.check_at_double_rate)},
          {"motion", motion_json(motion_shown(results))}};
}

}  // namespace combforce::paper

#include <fmt/format.h>

#include "daemon/cli/paper/beyond.hpp"
#include "daemon/cli/paper/report.hpp"
#include "proto/pixel_message.hpp"

namespace combforce::paper {
namespace {

std::string bias_table(const Beyond& beyond) {
  std::string text =
      "## The bias removed\n\nTones without noise. Paper: as printed. Partial: the paper's method, its "
      "average over the window converged. Refined: the motion off the comb found too. Bound: the "
      "standard error if each measured quadrature had the thermal noise S Delta f of one window of 2 ms at "
      "300 K.\n\n"
      "| case | parameter | true | paper | partial | refined | bound | status |\n"
      "|---|---|---:|---:|---:|---:|---:|---|\n";
  for (const Unbiased& row : beyond.cases)
    for (std::size_t k = 0; k < row.of->truth.size(); ++k)
      text += fmt::format("| {} | {} | {:.2f} | {:.2f} | {:.4f} | {:.4f} | {:.4f} | {} |\n",
                          k == 0 ? name(*row.of) : "", parameter_heads[k], row.of->truth[k],
                          row.of->printed.noise_free[k], row.partial.parameters[k], row.refined.parameters[k],
                          row.bound[k], k == 0 ? to_string(row.refined.status) : "");
  return text + "\n";
}

std::string statuses_text(const Coverage& coverage) {
  std::string text;
  for (std::size_t i = 0; i < coverage.statuses.size(); ++i)
    if (coverage.statuses[i] > 0)
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", coverage.statuses[i],
                          to_string(static_cast<FitStatus>(i)));
  return text;
}

std::string coverage_table(const Beyond& beyond) {
  std::string text =
      "## Whether the error bars hold\n\nPixels under thermal forces in the time domain, refined. Scatter: "
      "standard deviation of the fitted values; claimed: their median standard error; 68 %, 95 %: how often "
      "the interval of that level holds the truth.\n\n"
      "| case | pixels | parameter | true | mean | scatter | claimed | bound | 68 % | 95 % |\n"
      "|---|---|---|---:|---:|---:|---:|---:|---:|---:|\n";
  for (const Coverage& coverage : beyond.coverage)
    for (std::size_t k = 0; k < coverage.parameters.size(); ++k) {
      const ParameterCoverage& p = coverage.parameters[k];
      text += fmt::format("| {} | {} | {} | {:.2f} | {:.4f} | {:.4f} | {:.4f} | {:.4f} | {:.1f} | {:.1f} |\n",
                          k == 0 ? coverage.of->label : "", k == 0 ? statuses_text(coverage) : "",
                          parameter_heads[k], p.truth, p.mean, p.scatter, p.claimed, p.bound,
                          100.0 * p.within_68, 100.0 * p.within_95);
    }
  return text + "\n";
}

Json row_json(const Unbiased& row) {
  const Case& of = *row.of;
  return {{"case", of.key},
          {"model", of.model},
          {"truth", parameters_json(of, of.truth)},
          {"paper", parameters_json(of, of.printed.noise_free)},
          {"partial", parameters_json(of, row.partial.parameters)},
          {"refined", parameters_json(of, row.refined.parameters)},
          {"refined_status", to_string(row.refined.status)},
          {"bound", parameters_json(of, row.bound)}};
}

Json coverage_json(const Coverage& coverage) {
  const Case& of = find_case(coverage.of->paper_case);
  Json object{{"case", coverage.of->key}, {"pixels", coverage.pixels}, {"fitted", coverage.fitted}};
  for (std::size_t i = 0; i < coverage.statuses.size(); ++i)
    if (coverage.statuses[i] > 0)
      object["statuses"][std::string(to_string(static_cast<FitStatus>(i)))] = coverage.statuses[i];
  object["chi2_reduced"] = number9(coverage.chi2_reduced);
  const auto values = [&](double ParameterCoverage::*member) {
    std::vector<double> list;
    for (const ParameterCoverage& p : coverage.parameters) list.push_back(p.*member);
    return parameters_json(of, list);
  };
  object["mean"] = values(&ParameterCoverage::mean);
  object["scatter"] = values(&ParameterCoverage::scatter);
  object["claimed"] = values(&ParameterCoverage::claimed);
  object["bound"] = values(&ParameterCoverage::bound);
  object["within_68"] = values(&ParameterCoverage::within_68);
  object["within_95"] = values(&ParameterCoverage::within_95);
  return object;
}

}  // namespace

std::string markdown(const Beyond& beyond) {
  return "# Beyond Forchheimer, Borysov, Platz, Haviland 2014\n\n" + bias_table(beyond) +
         coverage_table(beyond);
}

Json json(const Beyond& beyond) {
  Json rows = Json::array(), coverages = Json::array();
  for (const Unbiased& row : beyond.cases) rows.push_back(row_json(row));
  for (const Coverage& coverage : beyond.coverage) coverages.push_back(coverage_json(coverage));
  return {{"bias", rows}, {"coverage", coverages}};
}

}  // namespace combforce::paper

#include "daemon/cli/paper/report.hpp"
#include "proto/pixel_message.hpp"

namespace combforce::paper {

Json parameters_json(const Case& of, std::span<const double> values) {
  Json object = Json::object();
  const ModelInfo& model = find_model(of.model);
  for (std::size_t k = 0; k < of.truth.size(); ++k)
    object[std::string(model.parameters[k].name)] = number9(values[k]);
  return object;
}

namespace {

Json draws_json(const Case& of, const Draws& draws) {
  std::vector<double> mean, spread, lower, median, upper;
  for (const Scatter& one : draws.scatter) {
    mean.push_back(one.mean);
    spread.push_back(one.spread);
    lower.push_back(one.lower);
    median.push_back(one.median);
    upper.push_back(one.upper);
  }
  Json statuses = Json::object();
  for (const FitResult& fit : draws.fits) {
    Json& count = statuses[std::string(to_string(fit.status))];
    count = count.is_null() ? 1 : count.get<int>() + 1;
  }
  return {{"statuses", statuses},
          {"draws_with_parameters", draws.valid},
          {"mean", parameters_json(of, mean)},
          {"standard_deviation", parameters_json(of, spread)},
          {"quantile_016", parameters_json(of, lower)},
          {"median", parameters_json(of, median)},
          {"quantile_084", parameters_json(of, upper)}};
}

Json row_json(const TableRow& row, const std::vector<std::string>& remarks) {
  const Case& of = *row.of;
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
            {"with_noise", draws_json(of, row.least)},
            {"with_noise_from_truth", draws_json(of, row.from_truth)}}},
          {"remarks", remarks}};
}

Json difference_json(const Difference& difference) {
  return {{"largest_nn", number9(difference.largest_nn)},
          {"standard_deviation_nn", number9(difference.spread_nn)}};
}

Json check_json(const SimulatorCheck& check) {
  Json object = difference_json(check.difference);
  object["case"] = check.of->key;
  return object;
}

Json band_json(const BandCheck& band) {
  Json rates = Json::array();
  for (const BandCheck::AtRate& rate : band.rates) {
    Json object = difference_json(rate.difference);
    object["sample_rate_hz"] = rate.sample_rate_hz;
    rates.push_back(object);
  }
  return {{"case", band.of->key}, {"rates", rates}, {"below_100_mhz", difference_json(band.in_band)}};
}

Json starts_json(const Starts& starts) {
  return {{"starts", starts.found.size()},
          {"share_found", number9(starts.found_share)},
          {"all_found_from_p0_nm", number9(starts.first_p0_nm)},
          {"all_found_to_p0_nm", number9(starts.last_p0_nm)}};
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

Json json(const Results& results) {
  Json tables = Json::array(), maps = Json::array(), curves = Json::array(), checks = Json::array();
  for (std::size_t i = 0; i < results.rows.size(); ++i)
    tables.push_back(row_json(results.rows[i], results.remarks[i]));
  for (const ErrorMap& map : results.maps)
    maps.push_back(
        {{"case", map.of->key}, {"ours", starts_json(map.ours)}, {"papers", starts_json(map.papers)}});
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
            {"draws", results.draws},
            {"seed", seed}}},
          {"tables", tables},
          {"error_maps", maps},
          {"force_curves", curves},
          {"simulator_check", checks},
          {"simulator_check_by_rate", band_json(results.band)},
          {"motion", motion_json(motion_shown(results))}};
}

}  // namespace combforce::paper

#include "daemon/record/truth_writer.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <stdexcept>

#include "proto/json.hpp"
#include "proto/pixel_message.hpp"

namespace combforce {

TruthWriter::TruthWriter(const std::string& path, SimulatedDigitizer& digitizer)
    : digitizer_(digitizer), model_(digitizer.model()) {
  if (std::filesystem::exists(path)) throw std::runtime_error(fmt::format("{}: exists already", path));
  file_.open(path);
  if (!file_) throw std::runtime_error(fmt::format("{}: cannot be written", path));
  digitizer_.set_truth_sink([this](const PixelTruth& truth) { write(truth); });
}

TruthWriter::~TruthWriter() {
  digitizer_.set_truth_sink(nullptr);
}

void TruthWriter::write(const PixelTruth& truth) {
  Json parameters = Json::object();
  for (std::size_t i = 0; i < model_.parameters.size(); ++i)
    parameters[std::string(model_.parameters[i].name)] = number9(truth.parameters[i]);
  const Json line{{"frame", truth.frame},
                  {"line", truth.line},
                  {"column", truth.column},
                  {"direction", to_string(truth.direction)},
                  {"first_sample", truth.first_sample},
                  {"parameters", parameters}};
  file_ << line.dump() << '\n' << std::flush;
}

}  // namespace combforce

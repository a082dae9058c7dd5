#include "daemon/cli/paper/figures.hpp"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>

#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "dsp/fourier.hpp"

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX leaves it to the user

namespace combforce::paper {
namespace {

class DataFile {
 public:
  DataFile(const std::filesystem::path& directory, const std::string& name, std::string_view header)
      : path_(directory / name), file_(path_) {
    write(header);
  }
  void write(std::string_view text) { file_ << text; }
  void close() {
    file_.close();
    if (!file_) throw std::runtime_error(fmt::format("{}: cannot be written", path_.string()));
  }

 private:
  std::filesystem::path path_;
  std::ofstream file_;
};

void write_map(const std::filesystem::path& directory, const ErrorMap& map) {
  DataFile file(directory, fmt::format("error_map_{}.dat", map.of->key),
                "# p0 (nm)  p1 (GPa nm^1/2)  E (nN^2)\n");
  for (std::size_t i = 0; i < map.p0_nm.size(); ++i) {
    for (std::size_t j = 0; j < map.p1.size(); ++j)
      file.write(fmt::format("{:.6g} {:.6g} {:.6g}\n", map.p0_nm[i], map.p1[j],
                             map.error_nn2[i * map.p1.size() + j]));
    file.write("\n");
  }
  file.close();
}

void write_starts(const std::filesystem::path& directory, const ErrorMap& map) {
  DataFile file(
      directory, fmt::format("starts_{}.dat", map.of->key),
      "# p0 (nm)  p1 (GPa nm^1/2)  1: the paper's fit from here finds the minimum, 0: it does not\n");
  const Starts& starts = map.papers;
  for (std::size_t i = 0; i < starts.found.size(); ++i)
    file.write(fmt::format("{:.6g} {:.6g} {}\n", starts.p0_nm[i / starts.p1.size()],
                           starts.p1[i % starts.p1.size()], starts.found[i]));
  file.close();
}

void write_minima(const std::filesystem::path& directory, const TableRow& row) {
  std::string header = "# first row: without noise; then one draw of the noise a row\n#";
  for (const ParameterInfo& parameter : find_model(row.of->model).parameters)
    header += fmt::format(" {}", parameter.name);
  DataFile file(directory, fmt::format("minima_{}.dat", row.of->key), header + "\n");
  const auto write = [&](const FitResult& fit) {
    for (std::size_t k = 0; k < row.of->truth.size(); ++k)
      file.write(fmt::format("{:.7g} ", fit.parameters[k]));
    file.write("\n");
  };
  write(row.noise_free);
  for (const FitResult& fit : row.least.fits)
    if (has_parameters(fit)) write(fit);
  file.close();
}

void write_curves(const std::filesystem::path& directory, const ForceCurves& curves) {
  DataFile file(directory, fmt::format("force_curves_{}.dat", curves.of->key),
                "# d (nm)  true force (nN)  force with the parameters of one noisy fit a column (nN)\n");
  for (std::size_t i = 0; i < curves.d_nm.size(); ++i) {
    file.write(fmt::format("{:.6g} {:.6g}", curves.d_nm[i], curves.true_nn[i]));
    for (const std::vector<double>& fitted : curves.fitted_nn) file.write(fmt::format(" {:.6g}", fitted[i]));
    file.write("\n");
  }
  file.close();
}

void write_check(const std::filesystem::path& directory, const SimulatorCheck& check, const BandCheck& band,
                 const CaseMotion& motion) {
  constexpr double highest_nm = -35.0;  // beyond, the force is all but zero and points are many
  DataFile file(directory, fmt::format("simulator_check_{}.dat", check.of->key),
                "# samples of the 2 ms at 200 MHz with d < -35 nm\n"
                "# d (nm)  force recovered by equation 7 (nN)  force used (nN)  difference (pN)  "
                "difference below 100 MHz (pN)\n");
  for (std::size_t i = 0; i < check.used_nn.size(); ++i) {
    const double d = motion.engaged.tip_motion_nm[i];
    if (d < highest_nm)
      file.write(fmt::format("{:.7g} {:.6g} {:.6g} {:.4g} {:.4g}\n", d, check.recovered_nn[i],
                             check.used_nn[i], 1e3 * (check.recovered_nn[i] - check.used_nn[i]),
                             1e3 * band.in_band_error_nn[i]));
  }
  file.close();
}

std::vector<const std::vector<double>*> signals(const CaseMotion& motion) {
  std::vector<const std::vector<double>*> all;
  for (const std::vector<double>& mode : motion.engaged.mode_motion_nm) all.push_back(&mode);
  all.push_back(&motion.engaged.tip_motion_nm);
  return all;
}

void write_motion(const std::filesystem::path& directory, const CaseMotion& motion) {
  constexpr double shown_s = 15e-6;
  DataFile file(directory, fmt::format("motion_{}.dat", motion.of->key),
                "# t (us, from the start of the analysed window)  q1  q2  q3  q4  d (nm)\n");
  for (std::size_t i = 0; i <= static_cast<std::size_t>(shown_s * sample_rate_hz); ++i) {
    file.write(fmt::format("{:.6g}", 1e6 * static_cast<double>(i) / sample_rate_hz));
    for (const std::vector<double>* one : signals(motion)) file.write(fmt::format(" {:.6g}", (*one)[i]));
    file.write("\n");
  }
  file.close();
}

void write_spectra(const std::filesystem::path& directory, const CaseMotion& motion) {
  constexpr double highest_hz = 5e6;
  DataFile file(
      directory, fmt::format("spectra_{}.dat", motion.of->key),
      "# f (kHz)  |q1|  |q2|  |q3|  |q4|  |d| (nm, peak)  |chi1|  |chi2|  |chi3|  |chi4|  |chi| (nm/nN)\n");
  std::vector<std::vector<std::complex<double>>> spectra;
  for (const std::vector<double>* one : signals(motion)) spectra.push_back(spectrum_of(*one));
  for (std::size_t k = 1; k <= static_cast<std::size_t>(highest_hz / delta_f_hz); ++k) {
    const double hz = delta_f_hz * static_cast<double>(k);
    file.write(fmt::format("{:.6g}", 1e-3 * hz));
    for (const auto& one : spectra) file.write(fmt::format(" {:.4g}", std::abs(one[k])));
    for (const Mode& mode : cantilever().modes)
      file.write(fmt::format(" {:.4g}", std::abs(mode_response(mode, hz))));
    file.write(fmt::format(" {:.4g}\n", std::abs(tip_response(cantilever(), hz))));
  }
  file.close();
}

// EE, EA: equal energy, equal amplitude.
std::string short_name(const Case& of) {
  return fmt::format("{} {} {}", of.model == "dmt" ? "DMT" : "Hertz", of.bins.size(),
                     of.scheme == DriveScheme::equal_energy ? "EE" : "EA");
}

// True: the script ran to its end. False: there is no gnuplot.
bool run_gnuplot(const std::filesystem::path& directory, const std::string& script) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, directory.c_str());
  std::string program = "gnuplot", argument = script;
  std::array<char*, 3> arguments{program.data(), argument.data(), nullptr};
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) return false;
  if (error != 0) throw std::runtime_error(fmt::format("gnuplot: {}", std::strerror(error)));
  int status = 0;
  while (::waitpid(child, &status, 0) == -1 && errno == EINTR) {
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    throw std::runtime_error(fmt::format("{}: gnuplot failed on it", (directory / script).string()));
  return true;
}

}  // namespace

void write_data(const std::filesystem::path& directory, const Results& results) {
  for (const ErrorMap& map : results.maps) {
    write_map(directory, map);
    write_starts(directory, map);
  }
  for (const TableRow& row : results.rows) write_minima(directory, row);
  for (const ForceCurves& curves : results.curves) write_curves(directory, curves);
  const CaseMotion& motion = motion_shown(results);
  for (const SimulatorCheck& check : results.checks)
    if (check.of == motion.of) write_check(directory, check, results.band, motion);
  write_motion(directory, motion);
  write_spectra(directory, motion);
}

void write_data(const std::filesystem::path& directory, const Beyond& beyond) {
  DataFile file(
      directory, "bias.dat",
      "# case and parameter  distance from the truth: the paper's method, refined, and the bound; p0 of "
      "1 nm, others of their value\n");
  for (const Unbiased& row : beyond.cases)
    for (std::size_t k = 0; k < row.of->truth.size(); ++k) {
      const double truth = row.of->truth[k], scale = k == 0 ? 1.0 : std::abs(truth);
      file.write(fmt::format("\"{}, p_{}\" {:.4g} {:.4g} {:.4g}\n", short_name(*row.of), k,
                             std::abs(row.partial.parameters[k] - truth) / scale,
                             std::abs(row.refined.parameters[k] - truth) / scale, row.bound[k] / scale));
    }
  file.close();
}

Drawing draw(const std::filesystem::path& directory, std::span<const Script> scripts) {
  for (const Script& script : scripts) {
    DataFile file(directory, fmt::format("{}.gp", script.name), script.text);
    file.close();
  }
  for (const Script& script : scripts)
    if (!run_gnuplot(directory, fmt::format("{}.gp", script.name))) return Drawing::no_gnuplot;
  return Drawing::done;
}

}  // namespace combforce::paper

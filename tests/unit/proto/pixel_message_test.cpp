#include "proto/pixel_message.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "proto/json.hpp"

namespace combforce {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

class PixelMessageTest : public testing::Test {
 protected:
  PixelMessageTest() {
    pixel.span = {
        .frame = 0, .line = 12, .column = 34, .direction = Direction::trace, .first_sample = 123456};
    pixel.channel_means = {0.25, 41.25};
    fit.status = FitStatus::converged;
    fit.refinements = 4;
    fit.iterations = 9;
    fit.parameters_count = 4;
    fit.chi2_reduced = 1.02;
    fit.parameters = {-40.0, 1.0, 5.0, 0.5};
    fit.std_errors = {0.0830000001234, 0.033, 0.146, 0.051};
    fit.correlation = {0.5, -0.25, 0.125, 1e-20, 0, 1.0 / 3.0};
    fit.virial_nn_nm = -12.5;
    fit.dissipated_fw = 1e15 / 7.0;
  }

  std::string line(PixelFields fields) const {
    std::string out = "kept ";
    append_pixel_line(out, {pixel, comb, channels, tip_nm, model, fit, tip}, fields);
    EXPECT_EQ(out.substr(0, 5), "kept ");
    EXPECT_EQ(out.find('\n'), out.size() - 1);
    EXPECT_NO_THROW(parse_json(out.substr(5), "line"));
    return out.substr(5);
  }

  Pixel pixel;
  Comb comb{4000, {{234, true}, {1348, true}}};
  Channels channels{{"deflection", ChannelRole::deflection, "V", 1.0, 0.0, std::nullopt},
                    {"z", ChannelRole::z, "nm", 1.0, 0.0, std::nullopt}};
  std::vector<std::complex<double>> tip_nm{{17.0529033662, -31.58430202558}, {-1e-7, 3}};
  const ModelInfo* model = &find_model("dmt");
  FitResult fit{};
  const TipGeometry* tip = nullptr;
};

constexpr auto head =
    R"({"jsonrpc":"2.0","method":"pixel","params":{"frame":0,"line":12,"column":34,"direction":"trace",)"
    R"("first_sample":123456,"flags":[],"channels":{"z_nm":41.25})";
constexpr auto tones = R"(,"tones":{"bin":[234,1348],"re_nm":[17.0529034,-1e-07],"im_nm":[-31.584302,3]})";
constexpr auto converged =
    R"(,"fit":{"model":"dmt","status":"converged","refinements":4,"iterations":9,"chi2_reduced":1.02,)"
    R"("parameters":{"surface_position_nm":-40,"contact_strength_gpa_sqrt_nm":1,"adhesion_nn":5,)"
    R"("contact_distance_nm":0.5},)"
    R"("std_errors":{"surface_position_nm":0.0830000001,"contact_strength_gpa_sqrt_nm":0.033,"adhesion_nn":0.146,)"
    R"("contact_distance_nm":0.051},)"
    R"("correlation":[0.5,-0.25,0.125,1e-20,0,0.333333333],"virial_nn_nm":-12.5,"dissipated_fw":1.42857143e+14})";

// The order and the keys of the contract's example.
TEST_F(PixelMessageTest, IsTheContractsExample) {
  EXPECT_EQ(line(PixelFields::all), std::string(head) + tones + converged + "}}\n");
}

TEST_F(PixelMessageTest, LeavesOutWhatIsNotAskedFor) {
  EXPECT_EQ(line(PixelFields::fit), std::string(head) + converged + "}}\n");
  EXPECT_EQ(line(PixelFields::tones), std::string(head) + tones + "}}\n");
}

TEST_F(PixelMessageTest, SaysNullForAFlaggedPixel) {
  pixel.flags.set(PixelFlag::sync);
  pixel.flags.set(PixelFlag::gap);
  pixel.channel_means[1] = nan;
  tip_nm.assign(2, {nan, nan});
  fit = unfitted(FitStatus::flagged, 4);
  fit.chi2_reduced = fit.virial_nn_nm = fit.dissipated_fw = nan;
  EXPECT_EQ(
      line(PixelFields::all),
      R"({"jsonrpc":"2.0","method":"pixel","params":{"frame":0,"line":12,"column":34,"direction":"trace",)"
      R"("first_sample":123456,"flags":["gap","sync"],"channels":{"z_nm":null},)"
      R"("tones":{"bin":[234,1348],"re_nm":[null,null],"im_nm":[null,null]},)"
      R"("fit":{"model":"dmt","status":"flagged","refinements":0,"iterations":0,"chi2_reduced":null,)"
      R"("parameters":null,"std_errors":null,"correlation":null,"virial_nn_nm":null,"dissipated_fw":null}}})"
      "\n");
}

TEST_F(PixelMessageTest, KeepsKnownValuesBesideUnknownOnes) {
  fit.status = FitStatus::at_bound;
  fit.std_errors = {0.1, nan, std::numeric_limits<double>::infinity(), 0.4};
  fit.correlation = {nan, nan, nan, nan, nan, nan};
  const Json json = Json::parse(line(PixelFields::fit))["params"]["fit"];
  EXPECT_EQ(json["status"], "at_bound");
  EXPECT_EQ(json["parameters"]["adhesion_nn"], 5.0);
  EXPECT_EQ(json["std_errors"].dump(),
            R"({"surface_position_nm":0.1,"contact_strength_gpa_sqrt_nm":null,"adhesion_nn":null,)"
            R"("contact_distance_nm":0.4})");
  EXPECT_TRUE(json["correlation"].is_null());
}

TEST_F(PixelMessageTest, HasIntervalsWhereTheyAreKnown) {
  fit.intervals[0] = {-40.25, -39.5};
  fit.intervals[3] = {0.25, nan};
  const Json json = Json::parse(line(PixelFields::fit))["params"]["fit"];
  EXPECT_EQ(json["intervals"].dump(),
            R"({"surface_position_nm":[-40.25,-39.5],"contact_strength_gpa_sqrt_nm":[null,null],)"
            R"("adhesion_nn":[null,null],"contact_distance_nm":[0.25,null]})");
}

TEST_F(PixelMessageTest, HasCalibrationErrorsAndOtherModelsWhereTheyWereAskedFor) {
  const std::string without = line(PixelFields::fit);
  EXPECT_EQ(without.find("calibration_errors"), std::string::npos);
  EXPECT_EQ(without.find("aicc"), std::string::npos);
  fit.calibration_errors = {1.5, 0.125, nan, 0.5, nan, nan};
  fit.aicc = 25.5;
  fit.compared[0] = {&find_model("hertz"), FitStatus::misfit, 1234.5, 9876.5};
  fit.compared[1] = {&find_model("cone"), FitStatus::not_converged, nan, nan};
  fit.compared_count = 2;
  const Json json = Json::parse(line(PixelFields::fit))["params"]["fit"];
  EXPECT_EQ(json["calibration_errors"].dump(),
            R"({"surface_position_nm":1.5,"contact_strength_gpa_sqrt_nm":0.125,)"
            R"("adhesion_nn":null,"contact_distance_nm":0.5})");
  EXPECT_EQ(json["aicc"], 25.5);
  EXPECT_EQ(json["compared"].dump(), R"({"hertz":{"status":"misfit","chi2_reduced":1234.5,"aicc":9876.5},)"
                                     R"("cone":{"status":"not_converged","chi2_reduced":null,"aicc":null}})");
}

TEST_F(PixelMessageTest, SaysOnlyTheStatusWithoutAModel) {
  model = nullptr;
  fit = unfitted(FitStatus::no_free_response, 0);
  EXPECT_EQ(line(PixelFields::fit),
            std::string(head) + R"(,"fit":{"model":null,"status":"no_free_response"}}})" + "\n");
}

TEST_F(PixelMessageTest, HasAnEmptyListWhereNothingCorrelates) {
  model = &find_model("hertz");
  fit.parameters_count = 2;
  EXPECT_EQ(Json::parse(line(PixelFields::fit))["params"]["fit"]["correlation"], Json::parse("[0.5]"));
}

TEST_F(PixelMessageTest, EscapesChannelNamesAndPutsVoltsInLowerCase) {
  channels[1].name = "a \"b\"";
  channels[1].unit = "V";
  pixel.span.direction = Direction::retrace;
  const Json json = Json::parse(line(PixelFields::tones))["params"];
  EXPECT_EQ(json["channels"], (Json{{"a \"b\"_v", 41.25}}));
  EXPECT_EQ(json["direction"], "retrace");
}

// p2 = 5 nN at p3 = 0.5 nm under 10 nm: H = 6 * 5 * 0.25/10 nN nm, w = 5/(20 pi) N/m, E* = 3/(4 sqrt(10))
// GPa.
TEST_F(PixelMessageTest, SaysTheMaterialWhereTheTipIsKnown) {
  TipGeometry geometry;
  geometry.radius_nm = 10.0;
  tip = &geometry;
  const std::string text = line(PixelFields::fit);
  EXPECT_NE(text.find(R"("dissipated_fw":1.42857143e+14,"material":{"reduced_modulus_gpa":0.237170825,)"
                      R"("hamaker_zj":750,"work_of_adhesion_mj_per_m2":79.5774715,)"),
            std::string::npos)
      << text;
  EXPECT_EQ(Json::parse(text)["params"]["fit"]["material"]["adhesion_theory"], "transition");
  fit = unfitted(FitStatus::no_contact, 4);
  EXPECT_FALSE(Json::parse(line(PixelFields::fit))["params"]["fit"].contains("material"));
}

TEST_F(PixelMessageTest, CarriesSampleIndicesExactly) {
  pixel.span.first_sample = (std::uint64_t{1} << 53) - 1;
  EXPECT_EQ(Json::parse(line(PixelFields::fit))["params"]["first_sample"], pixel.span.first_sample);
}

TEST(PixelMessageNames, AreThoseOfTheContract) {
  constexpr std::array statuses = {"converged",  "not_converged",    "at_bound",   "ill_conditioned",
                                   "no_contact", "no_free_response", "not_fitted", "flagged"};
  for (std::size_t i = 0; i < statuses.size(); ++i)
    EXPECT_EQ(to_string(static_cast<FitStatus>(i)), statuses[i]);
  PixelFlags flags;
  for (const auto flag : {PixelFlag::sync, PixelFlag::incoherent, PixelFlag::incomplete, PixelFlag::settling,
                          PixelFlag::clipped, PixelFlag::gap})
    flags.set(flag);
  EXPECT_EQ(flag_names(flags), (std::vector<std::string_view>{"gap", "clipped", "settling", "incomplete",
                                                              "incoherent", "sync"}));
}

}  // namespace
}  // namespace combforce

#include "offline/pages/report.h"

#include <fmt/format.h>
#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "tests/offline/sample_motion.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::MatchesOf;
using testing::ReadFile;
using ::testing::StartsWith;

/// The content of the page's data element as a browser finds it: all up to the first `</script`.
std::string DataElement(const std::string& page) {
  const std::string start = "<script type=\"application/json\" id=\"data\">";
  const std::size_t from = page.find(start) + start.size();
  return page.substr(from, page.find("</script", from) - from);
}

class Report : public ::testing::Test {
 protected:
  Report()
      : directory_(::testing::TempDir() + "tumbler_report_" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::filesystem::remove_all(directory_);
  }
  ~Report() override { std::filesystem::remove_all(directory_); }

  std::string Page(const ReportData& data) { return ReadFile(WriteReport(data, directory_)); }

  std::string Refusal(const ReportData& data) {
    try {
      WriteReport(data, directory_);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "accepted";
  }

  std::string directory_;
};

TEST_F(Report, CreatesTheDirectoryAndReturnsThePathOfThePage) {
  directory_ += "/made/on/the/way";
  const std::string path = WriteReport(SampleMotion(), directory_);
  EXPECT_EQ(path, directory_ + "/index.html");
  EXPECT_THAT(ReadFile(path), StartsWith("<!DOCTYPE html>"));
  std::filesystem::remove_all(::testing::TempDir() + "tumbler_report_made");
}

TEST_F(Report, HoldsEveryNumberOfItsDataExactly) {
  const ReportData data = SampleMotion();
  const Json page = Json::Parse(DataElement(Page(data))).value();
  EXPECT_EQ(page["title"], data.title);
  EXPECT_EQ(page["subtitle"], data.subtitle);
  EXPECT_EQ(page["duration_s"], data.duration_s);
  ASSERT_EQ(page["times_s"].size(), data.samples.size());
  ASSERT_EQ(page["links"].size(), data.links.size());
  ASSERT_EQ(page["joints"].size(), data.joint_names.size());
  for (std::size_t i = 0; i < data.samples.size(); ++i) {
    const ReportSample& sample = data.samples[i];
    EXPECT_EQ(page["times_s"][i], sample.time_s);
    EXPECT_EQ(page["root_pitch_rad"][i], sample.root_pitch_rad);
    for (std::size_t k = 0; k < data.links.size(); ++k) {
      const Json& link = page["links"][k];
      const std::array<double, 3> pose = {link["x_m"][i].number(), link["z_m"][i].number(),
                                          link["pitch_rad"][i].number()};
      EXPECT_EQ(pose, sample.link_poses[k]);
    }
    for (std::size_t k = 0; k < data.joint_names.size(); ++k) {
      const Json& joint = page["joints"][k];
      EXPECT_EQ(joint["position_rad"][i], sample.joint_positions_rad[k]);
      EXPECT_EQ(joint["velocity_rad_s"][i], sample.joint_velocities_rad_s[k]);
      EXPECT_EQ(joint["torque_nm"][i], sample.joint_torques_nm[k]);
    }
    ASSERT_EQ(page["forces"][i].size(), sample.forces.size());
    for (std::size_t k = 0; k < sample.forces.size(); ++k) {
      const ReportSample::Force& force = sample.forces[k];
      EXPECT_EQ(page["forces"][i][k], Json({{"x", force.x_m},
                                            {"z", force.z_m},
                                            {"fx", force.fx_n},
                                            {"fz", force.fz_n},
                                            {"nx", force.normal_x},
                                            {"nz", force.normal_z}}));
    }
  }
  for (std::size_t k = 0; k < data.joint_names.size(); ++k) {
    const Json& joint = page["joints"][k];
    EXPECT_EQ(joint["name"], data.joint_names[k]);
    EXPECT_EQ(joint["link"], k + 1);
    EXPECT_EQ(joint["torque_limit_nm"], data.torque_limits_nm[k]);
    EXPECT_EQ(joint["position_limits_rad"], Json(data.position_limits_rad[k]));
  }
  for (std::size_t k = 0; k < data.links.size(); ++k) {
    EXPECT_EQ(page["links"][k]["name"], data.links[k].name);
    ASSERT_EQ(page["links"][k]["shapes"].size(), data.links[k].shapes.size());
    for (std::size_t s = 0; s < data.links[k].shapes.size(); ++s) {
      const ReportShape& shape = data.links[k].shapes[s];
      EXPECT_EQ(page["links"][k]["shapes"][s], Json({{"corners", shape.corners_m},
                                                     {"r", shape.radius_m},
                                                     {"collides", shape.collides}}));
    }
  }
  ASSERT_EQ(page["evaluations"].size(), data.evaluations.size());
  for (std::size_t k = 0; k < data.evaluations.size(); ++k) {
    const ReportEvaluation& evaluation = data.evaluations[k];
    EXPECT_EQ(page["evaluations"][k], Json({{"evaluation", evaluation.evaluation},
                                            {"cost", evaluation.cost},
                                            {"violation", evaluation.violation},
                                            {"global", evaluation.global}}));
  }
  ASSERT_EQ(page["certificate"].size(), data.certificate.size());
  for (std::size_t k = 0; k < data.certificate.size(); ++k) {
    const auto& [name, value] = data.certificate[k];
    EXPECT_EQ(page["certificate"][k], Json::Array({name, value}));
  }
  ASSERT_EQ(page["obstacles"].size(), 1U);
  EXPECT_EQ(page["obstacles"][0]["name"], "ground");
  EXPECT_EQ(page["obstacles"][0]["corners"], Json(data.obstacles[0].corners_m));
  EXPECT_EQ(page["obstacles"][0]["r"], 0);
  EXPECT_EQ(page["ground_z"], 0);
}

TEST_F(Report, SaysWhichLinkEachJointMovesAndThatThereAreNoLimits) {
  ReportData data = SampleMotion();
  data.joint_links = {2, 1};
  data.torque_limits_nm.clear();
  data.position_limits_rad.clear();
  const Json page = Json::Parse(DataElement(Page(data))).value();
  EXPECT_EQ(page["joints"][0]["link"], 2);
  EXPECT_EQ(page["joints"][1]["link"], 1);
  EXPECT_TRUE(page["joints"][0]["torque_limit_nm"].is_null());
  EXPECT_TRUE(page["joints"][0]["position_limits_rad"].is_null());
}

TEST_F(Report, AsksForNothingFromOutside) {
  const std::string page = Page(SampleMotion());
  std::set<std::string> addresses;
  for (const auto& match : MatchesOf("[a-z]+://[^'\"[:space:]]*", page)) addresses.insert(match[0]);
  addresses.erase("http://www.w3.org/2000/svg");  // A name, not a place: browsers never fetch it.
  EXPECT_THAT(addresses, ::testing::IsEmpty());
  EXPECT_THAT(MatchesOf("@import|url\\([^#]", page), ::testing::IsEmpty());
  for (const auto& match :
       MatchesOf("(src|href|action|srcset)[[:space:]]*=[[:space:]]*[\"'](.{0,6})", page)) {
    EXPECT_EQ(match[2], "data:,") << match[0];
  }
  EXPECT_THAT(page, HasSubstr("content=\"default-src 'none';"));
}

TEST_F(Report, LeavesNoPlaceOfThePageUnfilled) {
  const std::string page = Page(SampleMotion());
  EXPECT_THAT(MatchesOf("\\{\\{[a-z.]+\\}\\}", page), ::testing::IsEmpty());
}

TEST_F(Report, TextCannotEndTheScriptOrTheTitle) {
  ReportData data = SampleMotion();
  const std::string hostile = "</script><script>alert(1)</script><!-- </title> & \"{{data}}\"";
  data.title = hostile;
  data.subtitle = hostile;
  data.joint_names[0] = hostile;
  data.certificate = {{hostile, hostile}};
  const std::string page = Page(data);
  const Json held = Json::Parse(DataElement(page)).value();
  EXPECT_EQ(held["title"], hostile);
  EXPECT_EQ(held["certificate"][0][1], hostile);
  EXPECT_THAT(page, ::testing::Not(HasSubstr("<script>alert")));
  EXPECT_THAT(page, HasSubstr("<title>&lt;/script&gt;"));
}

TEST_F(Report, TextThatIsNotUtf8BecomesReplacementCharacters) {
  ReportData data = SampleMotion();
  data.subtitle = "a\xff z";
  EXPECT_EQ(Json::Parse(DataElement(Page(data))).value()["subtitle"], "a\xEF\xBF\xBD z");
}

TEST_F(Report, OfTheSameDataIsTheSameToTheByte) {
  const std::string first = Page(SampleMotion());
  EXPECT_EQ(Page(SampleMotion()), first);
}

TEST_F(Report, RefusesEveryNumberThatIsNotFiniteByItsName) {
  const std::vector<std::pair<std::string, std::function<double*(ReportData&)>>> fields = {
      {"duration_s", [](ReportData& d) { return &d.duration_s; }},
      {"settle_s", [](ReportData& d) { return &d.settle_s; }},
      {"peak_torque.time_s",
       [](ReportData& d) {
         return &d.peak_torque.emplace(ReportPeak{1, 0, 0}).time_s;
       }},
      {"peak_torque.torque_nm",
       [](ReportData& d) {
         return &d.peak_torque.emplace(ReportPeak{1, 0, 0}).torque_nm;
       }},
      {"torque_limits_nm[1]", [](ReportData& d) { return &d.torque_limits_nm[1]; }},
      {"position_limits_rad[0][1]", [](ReportData& d) { return &d.position_limits_rad[0][1]; }},
      {"links[1].shapes[0].corners_m[0][0]",
       [](ReportData& d) { return &d.links[1].shapes[0].corners_m[0][0]; }},
      {"links[1].shapes[0].corners_m[1][1]",
       [](ReportData& d) { return &d.links[1].shapes[0].corners_m[1][1]; }},
      {"links[2].shapes[1].radius_m", [](ReportData& d) { return &d.links[2].shapes[1].radius_m; }},
      {"obstacles[0].corners_m[1][0]",
       [](ReportData& d) { return &d.obstacles[0].corners_m[1][0]; }},
      {"obstacles[0].corners_m[3][1]",
       [](ReportData& d) { return &d.obstacles[0].corners_m[3][1]; }},
      {"ground_z_m", [](ReportData& d) { return &*d.ground_z_m; }},
      {"obstacles[0].radius_m", [](ReportData& d) { return &d.obstacles[0].radius_m; }},
      {"samples[7].time_s", [](ReportData& d) { return &d.samples[7].time_s; }},
      {"samples[7].root_pitch_rad", [](ReportData& d) { return &d.samples[7].root_pitch_rad; }},
      {"samples[7].link_poses[2][1]", [](ReportData& d) { return &d.samples[7].link_poses[2][1]; }},
      {"samples[7].joint_positions_rad[1]",
       [](ReportData& d) { return &d.samples[7].joint_positions_rad[1]; }},
      {"samples[7].joint_velocities_rad_s[1]",
       [](ReportData& d) { return &d.samples[7].joint_velocities_rad_s[1]; }},
      {"samples[7].joint_torques_nm[0]",
       [](ReportData& d) { return &d.samples[7].joint_torques_nm[0]; }},
      {"samples[7].forces[0].x_m", [](ReportData& d) { return &d.samples[7].forces[0].x_m; }},
      {"samples[7].forces[0].z_m", [](ReportData& d) { return &d.samples[7].forces[0].z_m; }},
      {"samples[7].forces[0].fx_n", [](ReportData& d) { return &d.samples[7].forces[0].fx_n; }},
      {"samples[7].forces[0].fz_n", [](ReportData& d) { return &d.samples[7].forces[0].fz_n; }},
      {"samples[7].forces[0].normal_x",
       [](ReportData& d) { return &d.samples[7].forces[0].normal_x; }},
      {"evaluations[1501].cost", [](ReportData& d) { return &d.evaluations[1501].cost; }},
      {"evaluations[1501].violation", [](ReportData& d) { return &d.evaluations[1501].violation; }},
  };
  const ReportData good = SampleMotion();
  for (const auto& [name, field] : fields) {
    for (const double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
          -std::numeric_limits<double>::infinity()}) {
      ReportData data = good;
      *field(data) = bad;
      EXPECT_THAT(Refusal(data), StartsWith("report: " + name + ": is "));
    }
  }
  EXPECT_FALSE(std::filesystem::exists(directory_)) << "refused data must write nothing";
}

TEST_F(Report, RefusesSizesIndicesAndTimesThatDoNotFit) {
  const std::vector<std::pair<std::string, std::function<void(ReportData&)>>> faults = {
      {"samples: has 1 entries, must have at least 2", [](ReportData& d) { d.samples.resize(1); }},
      {"peak_torque.joint: is 2, must be the index of a joint, of which there are 2",
       [](ReportData& d) {
         d.peak_torque = ReportPeak{2, 0.5, 1};
       }},
      {"minima.rows[1]: has 1 texts, must have 2",
       [](ReportData& d) {
         d.minima = {{"#", "cost"}, {{"1", "0.1"}, {"2"}}};
       }},
      {"links: is empty", [](ReportData& d) { d.links.clear(); }},
      {"torque_limits_nm: has 1 entries, must have 2",
       [](ReportData& d) { d.torque_limits_nm.pop_back(); }},
      {"position_limits_rad: has 3 entries, must have 2",
       [](ReportData& d) { d.position_limits_rad.push_back({}); }},
      {"joint_links: is empty, and 2 joints cannot move links 1 to 2 of 2",
       [](ReportData& d) { d.links.pop_back(); }},
      {"joint_links: has 1 entries, must have 2", [](ReportData& d) { d.joint_links = {1}; }},
      {"joint_links[1]: is 3, must be from 0 to 2",
       [](ReportData& d) {
         d.joint_links = {1, 3};
       }},
      {"joint_links[0]: is -1, must be from 0 to 2",
       [](ReportData& d) {
         d.joint_links = {-1, 1};
       }},
      {"links[0].shapes[1].corners_m: is empty, must have at least one",
       [](ReportData& d) { d.links[0].shapes[1].corners_m.clear(); }},
      {"links[0].shapes[1].radius_m: is -0.1, must be at least 0",
       [](ReportData& d) { d.links[0].shapes[1].radius_m = -0.1; }},
      {"samples[9].link_poses: has 2 entries, must have 3: one for each link",
       [](ReportData& d) { d.samples[9].link_poses.pop_back(); }},
      {"samples[9].joint_positions_rad: has 1 entries",
       [](ReportData& d) { d.samples[9].joint_positions_rad.pop_back(); }},
      {"samples[9].joint_velocities_rad_s: has 1 entries",
       [](ReportData& d) { d.samples[9].joint_velocities_rad_s.pop_back(); }},
      {"samples[9].joint_torques_nm: has 3 entries",
       [](ReportData& d) { d.samples[9].joint_torques_nm.push_back(0); }},
      {"samples[10].time_s: is 0.045, must be later than the 0.045 before it",
       [](ReportData& d) { d.samples[10].time_s = d.samples[9].time_s; }},
      {"samples[9].forces[0].normal: has length 0, must have length 1",
       [](ReportData& d) { d.samples[9].forces[0].normal_z = 0; }},
      {"obstacles[0].corners_m: is empty, must have at least one",
       [](ReportData& d) { d.obstacles[0].corners_m.clear(); }},
      {"obstacles[0].radius_m: is 0, must be above 0",
       [](ReportData& d) { d.obstacles[0].corners_m.resize(1); }},
      {"obstacles[0].radius_m: is -1, must be at least 0",
       [](ReportData& d) { d.obstacles[0].radius_m = -1; }},
  };
  const ReportData good = SampleMotion();
  for (const auto& [message, spoil] : faults) {
    ReportData data = good;
    spoil(data);
    EXPECT_THAT(Refusal(data), StartsWith("report: " + message));
  }
}

TEST_F(Report, RefusedDataLeavesAnExistingPageAlone) {
  const std::string before = Page(SampleMotion());
  ReportData data = SampleMotion();
  data.duration_s = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(WriteReport(data, directory_), std::invalid_argument);
  EXPECT_EQ(ReadFile(directory_ + "/index.html"), before);
}

std::string WriteFailure(const std::string& directory) {
  try {
    WriteReport(SampleMotion(), directory);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "written";
}

TEST_F(Report, APlaceThatCannotBeWrittenIsAnErrorWithItsPath) {
  // A file where a directory is to be made fails for every user, root too.
  std::filesystem::create_directories(directory_);
  std::ofstream(directory_ + "/file") << "in the way";
  EXPECT_EQ(WriteFailure(directory_ + "/file/report"),
            fmt::format("{0}/file/report/index.html: cannot be written: {0}/file/report: Not a "
                        "directory",
                        directory_));
}

TEST_F(Report, APageThatCannotBeReplacedIsAnErrorAndLeavesNothingBehind) {
  std::filesystem::create_directories(directory_ + "/index.html/in_the_way");
  EXPECT_EQ(WriteFailure(directory_),
            directory_ + "/index.html: cannot be written: Is a directory");
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
    left.push_back(entry.path().filename());
  }
  EXPECT_THAT(left, ::testing::ElementsAre("index.html"));
}

TEST_F(Report, ADiskThatIsFullIsAnErrorWithThePath) {
  std::filesystem::create_directories(directory_);
  std::filesystem::create_symlink("/dev/full",
                                  fmt::format("{}/index.html.{}.tmp", directory_, getpid()));
  EXPECT_EQ(WriteFailure(directory_),
            directory_ + "/index.html: cannot be written: No space left on device");
  EXPECT_FALSE(std::filesystem::exists(directory_ + "/index.html"));
}

}  // namespace
}  // namespace tumbler

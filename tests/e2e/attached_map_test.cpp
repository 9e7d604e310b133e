// Desk and building: a map of one camera is hung on a stereo session, gets its scale from it, and what is placed on the
// one is found by the other.
#include <Eigen/Core>
#include <algorithm>

#include "tests/e2e/program_run.h"

namespace parallax::testing {
namespace {

constexpr const char* kBuilding = "synthetic:building?frames=240";

// Metres to a unit of the estimate, from where both have the camera.
double scale_of(const Trajectory& truth, const Trajectory& estimate) {
  Eigen::Matrix3Xd from(3, 0), to(3, 0);
  for (const TrajectoryPose& e : estimate)
    for (const TrajectoryPose& t : truth) {
      if (t.time != e.time) continue;
      from.conservativeResize(3, from.cols() + 1);
      to.conservativeResize(3, to.cols() + 1);
      from.rightCols<1>() = e.world_from_camera.t;
      to.rightCols<1>() = t.world_from_camera.t;
    }
  SimilarityTransform aligned;
  EXPECT_TRUE(align_points(from, to, true, &aligned));
  return aligned.s;
}

TEST(AttachedMap, HasTheBuildingsScaleAndWhatIsPlacedIsFoundByBoth) {
  const ScratchFolder folder;
  const std::string database = folder.file("building.db"), map = folder.file("corridor.plxmap");
  const auto parallax = [](const std::vector<std::string>& words) { return run_process(PARALLAX_BINARY, words); };
  const ProcessResult slam = parallax({"slam", kBuilding, "--name", "walk", "--pace", "lockstep", "--database",
                                       database, "--no-images", "--truth", folder.file("truth.txt"), "--keyframes",
                                       folder.file("keyframes.txt"), "--report", folder.file("report.json")});
  ASSERT_EQ(slam.exit_code, 0) << slam.err;
  const ProcessResult mono =
      parallax({"run", kBuilding, "--pace", "lockstep", "--map", map, "--trajectory", folder.file("mono.txt")});
  ASSERT_EQ(mono.exit_code, 0) << mono.err;

  const ProcessResult attached = parallax({"sessions", "attach", database, map, "--name", "corridor"});
  ASSERT_EQ(attached.exit_code, 0) << attached.err;
  const auto shown = nlohmann::json::parse(parallax({"sessions", "show", database, "walk", "--json"}).out);
  const double scale = shown.at("maps").at(0).at("scale");
  const double truth = scale_of(parse_trajectory(read_all(folder.file("truth.txt")), "truth"),
                                parse_trajectory(read_all(folder.file("mono.txt")), "mono"));
  EXPECT_NEAR(scale / truth, 1, 0.01);

  // The stereo camera points at something; the map gets the label, and the building knows where it stands.
  const int keyframe = 12;
  const Eigen::Vector2d pixel(200, 150);
  const ProcessResult placed =
      parallax({"sessions", "place", database, "--map", "corridor", "--label", "spill", "--session", "walk",
                "--keyframe", std::to_string(keyframe), "--pixel", "200", "150"});
  ASSERT_EQ(placed.exit_code, 0) << placed.err;
  const auto content = nlohmann::json::parse(parallax({"sessions", "content", database, "--json"}).out);
  ASSERT_EQ(content.size(), 1u);
  EXPECT_EQ(content[0].at("text"), "spill");
  const Eigen::Vector3d at(content[0].at("global_m")[0], content[0].at("global_m")[1], content[0].at("global_m")[2]);
  const Trajectory keyframes = parse_trajectory(read_all(folder.file("keyframes.txt")), "keyframes");
  const Eigen::Vector3d seen = keyframes.at(keyframe).world_from_camera.inverse() * at;
  const auto report = nlohmann::json::parse(read_all(folder.file("report.json")));
  const double focal = report.at("source").at("focal_px"), u0 = report.at("source").at("centre_px").at(0),
               v0 = report.at("source").at("centre_px").at(1);
  ASSERT_GT(seen.z(), 0.3);
  EXPECT_NEAR(focal * seen.x() / seen.z() + u0, pixel.x(), 0.05);
  EXPECT_NEAR(focal * seen.y() / seen.z() + v0, pixel.y(), 0.05);
  EXPECT_NE(parallax({"map", "info", map}).out.find("content    1"), std::string::npos);

  EXPECT_EQ(parallax({"sessions", "attach", database, map, "--name", "corridor"}).exit_code, 2);
  EXPECT_EQ(parallax({"sessions", "detach", database, "corridor"}).exit_code, 0);
  EXPECT_EQ(parallax({"sessions", "detach", database, "corridor"}).exit_code, 2);
}

TEST(AttachedMap, AnotherPlaceIsNotTakenForTheBuilding) {
  const ScratchFolder folder;
  const std::string database = folder.file("building.db"), map = folder.file("desk.plxmap");
  ASSERT_EQ(run_process(PARALLAX_BINARY, {"slam", "synthetic:building?frames=80", "--pace", "lockstep", "--database",
                                          database, "--no-images"})
                .exit_code,
            0);
  ASSERT_EQ(
      run_process(PARALLAX_BINARY, {"run", "synthetic:desk?frames=120", "--pace", "lockstep", "--map", map}).exit_code,
      0);
  const ProcessResult attached = run_process(PARALLAX_BINARY, {"sessions", "attach", database, map});
  EXPECT_EQ(attached.exit_code, 1) << attached.out;
  EXPECT_NE(attached.err.find("not attached"), std::string::npos) << attached.err;
}

}  // namespace
}  // namespace parallax::testing

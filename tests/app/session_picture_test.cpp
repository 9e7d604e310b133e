// Pictures of sessions: what is drawn is where the scale says, in the colours that the legend names.
#include "app/session_picture.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "app/session_report_data.h"
#include "app/session_view_drawing.h"
#include "core/error.h"
#include "sessions/session_optimiser.h"
#include "tests/app/session_run_maker.h"
#include "tests/support/process.h"

namespace parallax {
namespace {

using Eigen::Vector3d;

bool same(CanvasColour a, CanvasColour b) { return a.red == b.red && a.green == b.green && a.blue == b.blue; }

// Keeps what is drawn.
class RecordingSheet : public Canvas {
 public:
  struct Line {
    std::vector<CanvasPoint> points;
    CanvasColour colour;
    double width_px;
  };
  void polyline(const std::vector<CanvasPoint>& points, CanvasColour colour, double width_px) override {
    lines.push_back({points, colour, width_px});
  }
  void text(CanvasPoint, const std::string& text, double, TextAnchor, CanvasColour) override { texts.push_back(text); }
  void image(CanvasPoint, const cv::Mat3b&) override {}
  void save(const std::string&) const override {}

  std::vector<Line> of(CanvasColour colour, double width_px) const {
    std::vector<Line> out;
    for (const Line& line : lines)
      if (same(line.colour, colour) && line.width_px == width_px) out.push_back(line);
    return out;
  }
  bool says(const std::string& what) const {
    return std::any_of(texts.begin(), texts.end(), [&](const std::string& t) { return t.find(what) != t.npos; });
  }
  std::vector<Line> lines;
  std::vector<std::string> texts;
};

struct Drawn {
  RecordingSheet sheet;
  std::vector<SessionPlotPlace> places;
  int width = 0, height = 0;
};

Drawn draw(const SessionScene& scene, const SessionPictureOptions& options) {
  Drawn out;
  out.places = draw_sessions(scene, options, [&](int width, int height) {
    out.width = width;
    out.height = height;
    return &out.sheet;
  });
  return out;
}

SessionScene made_scene() { return scene_of_run(testing::made_run(), ""); }

void expect_near(CanvasPoint found, CanvasPoint expected) {
  EXPECT_NEAR(found.x, expected.x, 1e-6);
  EXPECT_NEAR(found.y, expected.y, 1e-6);
}

TEST(SessionScene, IsTheGlobalFrameAndActiveEncountersOnly) {
  const SlamSessionsResult run = testing::made_run();
  const SessionScene scene = make_session_scene(run.view);
  ASSERT_EQ(scene.sessions.size(), 3U);
  const Vector3d expected =
      run.view.sessions[1].global_from_session * run.sessions[1].result.keyframes[9].world_from_camera.t;
  EXPECT_LT((scene.pose({2, 9})->global_from_camera.t - expected).norm(), 1e-12);
  EXPECT_DOUBLE_EQ(scene.pose({2, 9})->seconds, 9 * 0.25);
  EXPECT_EQ(scene.pose({2, 80}), nullptr);
  EXPECT_EQ(scene.pose({4, 0}), nullptr);
  ASSERT_EQ(scene.links.size(), 4U);
  EXPECT_TRUE(scene.links[0].within_session());
  EXPECT_EQ(scene.links[3].query, (PoseKey{2, 40}));
  // Frames between keyframes, before the first and after the last.
  EXPECT_DOUBLE_EQ(scene.sessions[0].seconds_of_frame(12), 0.25 * 12 / 5);
  EXPECT_DOUBLE_EQ(scene.sessions[0].seconds_of_frame(-3), 0);
  EXPECT_DOUBLE_EQ(scene.sessions[0].seconds_of_frame(9999), 124 * 0.25);
  const std::vector<SessionScene> parts = scene.components();
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].links.size(), 4U);
  EXPECT_EQ(parts[1].sessions.front().name, "yard");
  EXPECT_EQ(scene.only(1).links.size(), 1U);
}

TEST(SessionScene, SpreadOfAPlaceFollowsFromThatOfThePose) {
  Matrix6d root = Matrix6d::Random();
  const Matrix6d covariance = root * root.transpose();
  const RigidTransform pose(exp_so3({0.3, -0.8, 0.2}), {4, -1, 7});
  Eigen::Matrix<double, 3, 6> numeric;
  constexpr double step = 1e-6;
  for (int i = 0; i < 6; ++i) {
    const Vector6d e = step * Vector6d::Unit(i);
    numeric.col(i) = ((RigidTransform::exp(e) * pose).t - (RigidTransform::exp(-e) * pose).t) / (2 * step);
  }
  const Eigen::Matrix3d expected = numeric * covariance * numeric.transpose();
  EXPECT_LT((place_covariance(covariance, pose.t) - expected).norm(), 1e-6 * expected.norm());
}

TEST(SessionScene, SpreadsAreThoseOfTheGraph) {
  const SlamSessionsResult run = testing::made_run({{"a", 40, 1, {}, 4}});
  const SessionScene scene = scene_of_run(run, "");
  SessionDocument document;
  document.sessions = run.view.sessions;
  document.poses = run.view.poses;
  for (const StereoConstraint& c : run.sessions[0].result.constraints) document.constraints.push_back({1, c});
  SessionGraph graph;
  build_session_graph(document, &graph);
  graph.optimise();
  ASSERT_EQ(scene.spreads.size(), 12U);
  EXPECT_EQ(scene.spreads.back().key, (PoseKey{1, 39}));
  for (const SceneSpread& spread : scene.spreads) {
    Matrix6d covariance;
    ASSERT_TRUE(graph.covariance(spread.key, &covariance));
    const Eigen::Matrix3d expected = place_covariance(covariance, scene.pose(spread.key)->global_from_camera.t);
    EXPECT_LT((spread.covariance - expected).norm(), 1e-9 * expected.norm());
  }
  EXPECT_GT(scene.spreads.back().covariance.trace(), 4 * scene.spreads.front().covariance.trace());
  // Every point of the map is half a metre right of, 0.2 below and two ahead of its keyframe.
  ASSERT_EQ(scene.sessions[0].points.size(), 40U);
  const Vector3d point = scene.pose({1, 17})->global_from_camera * Vector3d(0.5, 0.2, 2);
  EXPECT_LT((scene.sessions[0].points[17].position.cast<double>() - point).norm(), 1e-5);
}

TEST(SessionScene, SessionsHaveColoursOfTheirOwn) {
  for (int a = 0; a < 10; ++a) {
    for (int b = 0; b < a; ++b) EXPECT_FALSE(same(session_colour(a), session_colour(b))) << a << ' ' << b;
    EXPECT_FALSE(same(session_colour(a), kWithinSessionColour));
    EXPECT_FALSE(same(session_colour(a), kBetweenSessionsColour));
  }
}

TEST(SessionPicture, FromAboveEveryPoseIsWhereTheScaleSays) {
  const SessionScene scene = made_scene();
  const Drawn drawn = draw(scene, {});
  ASSERT_EQ(drawn.places.size(), 2U);
  EXPECT_TRUE(drawn.sheet.says("Not all sessions have met: 2 parts"));
  for (const SceneSession& session : scene.sessions) {
    const SessionPlotPlace& plot = drawn.places[session.component == 1 ? 0 : 1];
    EXPECT_TRUE(drawn.sheet.says(session.name));
    const auto ways = drawn.sheet.of(session.colour, 2);
    ASSERT_EQ(ways.front().points.size(), session.poses.size());
    for (std::size_t i = 0; i < session.poses.size(); ++i) {
      const Vector3d& place = session.poses[i].global_from_camera.t;
      const CanvasPoint at = plot.at(place, session.id, session.poses[i].seconds);
      expect_near(ways.front().points[i], at);
      EXPECT_GE(at.x, plot.corner.x);
      EXPECT_LE(at.x, plot.corner.x + plot.width_px);
      EXPECT_GE(at.y, plot.corner.y);
      EXPECT_LE(at.y, plot.corner.y + plot.height_px);
      EXPECT_LE(plot.corner.y + plot.height_px, drawn.height);
    }
    // Right is the first camera's right, up the page is ahead of it.
    const CanvasPoint o = plot.at({0, 0, 0}, session.id, 0), x = plot.at({1, 0, 0}, session.id, 0),
                      z = plot.at({0, 0, 1}, session.id, 0), y = plot.at({0, 1, 0}, session.id, 9);
    expect_near(x, {o.x + plot.px_per_m, o.y});
    expect_near(z, {o.x, o.y - plot.px_per_m});
    expect_near(y, o);
  }
  EXPECT_GT(drawn.places[1].corner.x, drawn.places[0].corner.x + drawn.places[0].width_px);
  EXPECT_LE(drawn.places[1].corner.x + drawn.places[1].width_px, drawn.width);
}

TEST(SessionPicture, LinksJoinTheKeyframesThatMetInTwoColours) {
  const SessionScene scene = made_scene();
  for (const SessionPictureView view : {SessionPictureView::from_above, SessionPictureView::elevation}) {
    SessionPictureOptions options;
    options.view = view;
    const Drawn drawn = draw(scene, options);
    const auto within = drawn.sheet.of(kWithinSessionColour, 1.2),
               between = drawn.sheet.of(kBetweenSessionsColour, 1.2);
    ASSERT_EQ(within.size(), 1U);
    ASSERT_EQ(between.size(), 3U);
    const auto at = [&](int session, int keyframe) {
      const ScenePose& pose = *scene.pose({session, keyframe});
      return drawn.places[0].at(pose.global_from_camera.t, session, pose.seconds);
    };
    expect_near(within[0].points[0], at(1, 0));
    expect_near(within[0].points[1], at(1, 124));
    expect_near(between[2].points[0], at(1, 30));
    expect_near(between[2].points[1], at(2, 40));
    EXPECT_TRUE(drawn.sheet.says("within a session: 1"));
    EXPECT_TRUE(drawn.sheet.says("between sessions: 3"));
  }
}

TEST(SessionPicture, ElevationGrowsWithSessionTimeAndSessionsStack) {
  const SessionScene scene = made_scene();
  SessionPictureOptions options;
  options.view = SessionPictureView::elevation;
  const Drawn drawn = draw(scene, options);
  const auto& at = drawn.places[0].at;
  const Vector3d place(1, 0, 2);
  const double zero = at(place, 1, 0).y, ten = at(place, 1, 10).y, twenty = at(place, 1, 20).y;
  EXPECT_LT(ten, zero - 5);
  EXPECT_NEAR(zero - twenty, 2 * (zero - ten), 1e-6);
  EXPECT_DOUBLE_EQ(at(place, 1, 0).x, at(place, 1, 20).x);
  EXPECT_LT(at(place, 2, 0).y, at(place, 1, scene.sessions[0].seconds()).y);
  // How high a place is in the building does not count.
  expect_near(at({1, -5, 2}, 1, 0), at(place, 1, 0));
  const auto ways = drawn.sheet.of(scene.sessions[1].colour, 2);
  const bool drawn_there = std::any_of(ways.begin(), ways.end(), [&](const RecordingSheet::Line& line) {
    if (line.points.size() != scene.sessions[1].poses.size()) return false;
    const ScenePose& last = scene.sessions[1].poses.back();
    const CanvasPoint end = at(last.global_from_camera.t, 2, last.seconds);
    return std::hypot(line.points.back().x - end.x, line.points.back().y - end.y) < 1e-6;
  });
  EXPECT_TRUE(drawn_there);
}

TEST(SessionPicture, EllipsesHold95PercentToScale) {
  SessionScene scene = scene_of_run(testing::made_run({{"a", 60, 1, {}, 4}}), "");
  scene.spreads.clear();
  // 0.3 m along x, 0.1 m along z; height does not show from above.
  scene.spreads.push_back({{1, 30}, Vector3d(0.09, 4, 0.01).asDiagonal()});
  const Drawn drawn = draw(scene, {});
  const auto ellipses = drawn.sheet.of(scene.sessions[0].colour, 1);
  ASSERT_EQ(ellipses.size(), 1U);
  const CanvasPoint middle = drawn.places[0].at(scene.pose({1, 30})->global_from_camera.t, 1, 0);
  double wide = 0, high = 0;
  for (const CanvasPoint& p : ellipses[0].points) {
    wide = std::max(wide, std::abs(p.x - middle.x));
    high = std::max(high, std::abs(p.y - middle.y));
  }
  const double radius = std::sqrt(-2 * std::log(0.05));  // of two degrees of freedom
  EXPECT_NEAR(wide / drawn.places[0].px_per_m, 0.3 * radius, 1e-6);
  EXPECT_NEAR(high / drawn.places[0].px_per_m, 0.1 * radius, 1e-6);
  EXPECT_TRUE(drawn.sheet.says("longest half axis 73 cm"));
}

TEST(SessionPicture, AWayThatNobodySawIsDrawnFaint) {
  SlamSessionsResult run = testing::made_run({{"a", 30, 1, {}, 4}});
  run.view.poses[12].after_failure = true;
  const SessionScene scene = make_session_scene(run.view);
  const Drawn drawn = draw(scene, {});
  const auto ways = drawn.sheet.of(scene.sessions[0].colour, 2);
  EXPECT_EQ(ways[0].points.size(), 12U);
  EXPECT_EQ(ways[1].points.size(), 18U);
}

TEST(SessionPicture, PngShowsWaysPointsAndTheFloorPlanInTheirPlaces) {
  const testing::ScratchFolder folder;
  SessionScene scene = make_session_scene(testing::made_run({{"a", 60, 1, {}, 4}}).view);
  scene.sessions[0].textured = true;
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j)
      scene.sessions[0].points.push_back(
          {Eigen::Vector3f(5.0F + 0.02F * static_cast<float>(i), 0.5F, 1.0F + 0.02F * static_cast<float>(j)),
           {200, 20, 30},
           0});
  SessionPictureOptions options;
  FloorPlan plan;  // white, but for a black metre from (2, 0.5) to (3, 1.5)
  plan.image = cv::Mat3b(80, 120, cv::Vec3b(255, 255, 255));
  plan.image(cv::Rect(60, 30, 20, 20)) = cv::Vec3b(0, 0, 0);
  plan.corner_m = {-1, -1};
  options.floor_plan = plan;
  const std::string path = folder.file("map.png");
  write_session_picture(scene, options, path);
  const cv::Mat3b image = cv::imread(path);
  const SessionPlotPlace plot = draw(scene, options).places[0];
  const auto pixel = [&](const Vector3d& place) {
    const CanvasPoint p = plot.at(place, 1, 0);
    return image(cvRound(p.y), cvRound(p.x));
  };
  EXPECT_EQ(pixel({5.2, 0, 1.2}), cv::Vec3b(30, 20, 200));
  const CanvasColour blue = scene.sessions[0].colour;
  const cv::Vec3b on_way = pixel(scene.pose({1, 20})->global_from_camera.t);
  EXPECT_LT(cv::norm(on_way - cv::Vec3b(static_cast<uchar>(blue.blue), static_cast<uchar>(blue.green),
                                        static_cast<uchar>(blue.red))),
            60);
  // Corner (-1, -1), 0.05 m a pixel: columns 60 to 80 are x 2 to 3, rows 30 to 50 from the top z 0.5 to 1.5.
  EXPECT_LT(pixel({2.3, 0, 0.8})[0], 160);
  EXPECT_LT(pixel({2.7, 0, 1.3})[1], 160);
  EXPECT_GT(pixel({3.3, 0, 0.8})[0], 240);
  EXPECT_GT(pixel({2.3, 0, 1.8})[0], 240);
}

TEST(SessionPicture, WhatCannotBeDrawnIsRefused) {
  const testing::ScratchFolder folder;
  EXPECT_THROW(write_session_picture(made_scene(), {}, folder.file("map.jpg")), InputError);
  SlamSessionsResult run = testing::made_run({{"a", 5, 1, {}, 4}});
  run.view.poses.clear();
  EXPECT_THROW(write_session_picture(make_session_scene(run.view), {}, folder.file("map.svg")), RunError);
  EXPECT_THROW(write_session_picture(made_scene(), {}, folder.file("no/such/map.svg")), RunError);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(SessionView, SessionsThatHaveNotMetStandSideBySide) {
  SessionViewSnapshot snapshot;
  snapshot.scene = made_scene();
  const SessionStage stage(snapshot, false);
  EXPECT_EQ(stage.components(), 2);
  double right_of_first = -1e9, left_of_second = 1e9;
  for (const SceneSession& session : snapshot.scene.sessions)
    for (const ScenePose& pose : session.poses) {
      const Vector3d p = stage.at(pose.global_from_camera.t, session.id, pose.seconds);
      if (session.component == 1)
        right_of_first = std::max(right_of_first, p.x());
      else
        left_of_second = std::min(left_of_second, p.x());
      EXPECT_TRUE((p.array() >= stage.low().array() - 1e-9).all() && (p.array() <= stage.high().array() + 1e-9).all());
      EXPECT_NEAR(p.z(), -pose.global_from_camera.t.y(), 1e-9);  // z is up
    }
  EXPECT_NEAR(left_of_second - right_of_first, 3, 1e-9);
}

TEST(SessionView, DrawsWaysLinksAndEllipsesWhereTheyAre) {
  SessionViewSnapshot snapshot;
  snapshot.scene = made_scene();
  // A keyframe ahead of what the graph holds of the first session.
  const Vector3d last = snapshot.scene.sessions[0].poses.back().global_from_camera.t,
                 ahead = last + Vector3d(0, 0, 0.5);
  snapshot.tails.push_back({1, {last, ahead}, {Eigen::Matrix3d::Identity(), ahead}});
  SessionViewSettings settings;
  const auto lines = [&](const SessionViewSettings& with) {
    return session_view_list(snapshot, with, {}, 640, 480).world_lines.size();
  };
  const auto has = [&](const DrawList& list, const Vector3d& a, const Vector3d& b) {
    return std::any_of(list.world_lines.begin(), list.world_lines.end(), [&](const WorldLine& line) {
      return (line.a - a.cast<float>()).norm() < 1e-4f && (line.b - b.cast<float>()).norm() < 1e-4f;
    });
  };
  for (const bool elevation : {false, true}) {
    settings.elevation = elevation;
    const SessionStage stage(snapshot, elevation);
    const DrawList list = session_view_list(snapshot, settings, {}, 640, 480);
    const auto at = [&](int session, int keyframe) {
      const ScenePose& pose = *snapshot.scene.pose({session, keyframe});
      return stage.at(pose.global_from_camera.t, session, pose.seconds);
    };
    EXPECT_TRUE(has(list, at(2, 30), at(2, 31)));
    EXPECT_TRUE(has(list, at(1, 30), at(2, 40)));
    EXPECT_TRUE(has(list, at(1, 0), at(1, 124)));
    EXPECT_FALSE(has(list, at(1, 60), at(2, 70)));  // not confirmed
    EXPECT_TRUE(has(list, stage.at(last, 1, 31), stage.at(ahead, 1, 31)));
    EXPECT_EQ(list.world_points.empty(), elevation);
  }
  SessionStage stage(snapshot, true);
  EXPECT_GT(stage.at(last, 1, 20).z(), stage.at(last, 1, 10).z());
  EXPECT_GT(stage.at(last, 2, 0).z(), stage.at(last, 1, 31).z());
  SessionViewSettings without = settings;
  without.links = false;
  EXPECT_EQ(lines(settings) - lines(without), 4U);
  without = settings;
  without.ellipses = false;
  EXPECT_EQ(lines(settings) - lines(without), 24 * snapshot.scene.spreads.size());
}

}  // namespace
}  // namespace parallax

// The report on sessions is well-formed, and says what went into it: every figure and every dot of every plot.
#include "app/session_report.h"

#include <gtest/gtest.h>

#include <cctype>
#include <cstdlib>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <stdexcept>

#include "app/session_report_svg.h"
#include "core/error.h"
#include "tests/app/session_run_maker.h"
#include "tests/support/process.h"

namespace parallax {
namespace {

struct Element {
  std::string name;
  std::map<std::string, std::string> attributes;
  std::string text;  // of it and what it holds
  std::vector<std::unique_ptr<Element>> children;

  void collect(const std::string& wanted, std::vector<const Element*>* out) const {
    if (name == wanted) out->push_back(this);
    for (const auto& child : children) child->collect(wanted, out);
  }
  std::vector<const Element*> all(const std::string& wanted) const {
    std::vector<const Element*> out;
    collect(wanted, &out);
    return out;
  }
  std::string attribute(const std::string& key) const {
    const auto found = attributes.find(key);
    return found == attributes.end() ? std::string() : found->second;
  }
  double number(const std::string& key) const { return std::strtod(attribute(key).c_str(), nullptr); }
};

// As strict as XML is about what we write: every element closed, attributes quoted and single, entities known.
class StrictReader {
 public:
  explicit StrictReader(const std::string& text) : text_(text) {}

  std::unique_ptr<Element> read() {
    if (text_.rfind("<!DOCTYPE html>\n", 0) == 0) at_ = 16;
    auto root = element();
    while (at_ < text_.size())
      require(std::isspace(static_cast<unsigned char>(text_[at_++])) != 0, "text after the end");
    return root;
  }

 private:
  void require(bool sound, const std::string& what) const {
    if (!sound) throw std::runtime_error(what + " at " + std::to_string(at_) + ": " + text_.substr(at_, 60));
  }
  bool next_is(const std::string& what) const { return text_.compare(at_, what.size(), what) == 0; }
  std::string name() {
    const std::size_t begin = at_;
    while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) != 0 || text_[at_] == '-'))
      ++at_;
    require(at_ > begin, "a name");
    return text_.substr(begin, at_ - begin);
  }
  // Up to the letter `end`.
  std::string characters(char end) {
    std::string out;
    for (; at_ < text_.size() && text_[at_] != end; ++at_) {
      const char c = text_[at_];
      require(c != '<' && (static_cast<unsigned char>(c) >= 0x20 || c == '\n'), "a letter that may not be");
      if (c != '&') {
        out += c;
        continue;
      }
      const std::size_t close = text_.find(';', at_);
      require(close != std::string::npos && close < at_ + 8, "an entity");
      const std::string entity = text_.substr(at_ + 1, close - at_ - 1);
      const std::map<std::string, std::string> known{
          {"lt", "<"}, {"gt", ">"}, {"amp", "&"}, {"quot", "\""}, {"#39", "'"}};
      require(known.contains(entity) || entity.rfind('#', 0) == 0, "a known entity");
      out += known.contains(entity) ? known.at(entity) : "?";
      at_ = close;
    }
    return out;
  }
  std::unique_ptr<Element> element() {
    require(next_is("<"), "an element");
    ++at_;
    auto out = std::make_unique<Element>();
    out->name = name();
    while (next_is(" ")) {
      ++at_;
      const std::string key = name();
      require(next_is("=\""), "a quoted value");
      at_ += 2;
      require(out->attributes.emplace(key, characters('"')).second, "an attribute once");
      ++at_;
    }
    if (next_is("/>")) {
      at_ += 2;
      return out;
    }
    require(next_is(">"), "the end of a tag");
    ++at_;
    while (true) {
      out->text += characters('<');
      require(at_ < text_.size(), "an end tag");
      if (next_is("</")) break;
      out->children.push_back(element());
      out->text += out->children.back()->text;
    }
    at_ += 2;
    require(name() == out->name, "the right end tag");
    require(next_is(">"), "the end of an end tag");
    ++at_;
    return out;
  }

  const std::string& text_;
  std::size_t at_ = 0;
};

class SessionReport : public ::testing::Test {
 protected:
  void make(const SessionReportData& data) {
    page_ = session_report_page(data);
    root_ = StrictReader(page_).read();
    ids_.clear();
    find_ids(*root_);
  }
  void find_ids(const Element& element) {
    if (!element.attribute("id").empty()) {
      EXPECT_TRUE(ids_.emplace(element.attribute("id"), &element).second) << element.attribute("id") << " twice";
    }
    for (const auto& child : element.children) find_ids(*child);
  }
  std::string cell(const std::string& id) const { return ids_.contains(id) ? ids_.at(id)->text : "no " + id; }
  double figure(const std::string& id) const { return std::strtod(cell(id).c_str(), nullptr); }

  // The values that a plot's series shows, read off its axes.
  std::vector<CanvasPoint> shown(const std::string& plot, const std::string& series) const {
    std::vector<CanvasPoint> out;
    for (const Element* svg : root_->all("svg")) {
      if (svg->attribute("data-plot") != plot) continue;
      for (const Element* group : svg->all("g")) {
        if (group->attribute("data-series") != series) continue;
        for (const auto& drawn : group->children) {
          std::string points = drawn->attribute(drawn->name == "path" ? "d" : "points");
          for (char& c : points)
            if (c == 'M' || c == 'h' || c == ',') c = ' ';
          std::istringstream in(points);
          double x = 0, y = 0, nothing = 0;
          while (in >> x >> y) {
            out.push_back({(x - svg->number("data-left")) / svg->number("data-width") * svg->number("data-x"),
                           (1 - (y - svg->number("data-top")) / svg->number("data-height")) * svg->number("data-y")});
            if (drawn->name == "path") in >> nothing;
          }
        }
      }
    }
    return out;
  }
  void expect_shown(const std::string& plot, const std::string& series,
                    const std::vector<CanvasPoint>& expected) const {
    const std::vector<CanvasPoint> found = shown(plot, series);
    ASSERT_EQ(found.size(), expected.size()) << plot << ' ' << series;
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_NEAR(found[i].x, expected[i].x, 0.3) << plot << ' ' << series << ' ' << i;  // hundredths of a pixel
      EXPECT_NEAR(found[i].y, expected[i].y, 0.3) << plot << ' ' << series << ' ' << i;
    }
  }

  std::string page_;
  std::unique_ptr<Element> root_;
  std::map<std::string, const Element*> ids_;
};

TEST_F(SessionReport, Table1CountsSessionsLoopsAndMeetings) {
  make(report_on_run(testing::made_run(), {}));
  EXPECT_EQ(cell("t1-1-poses"), "125");
  EXPECT_EQ(cell("t1-1-length"), "0:31");
  EXPECT_EQ(cell("t1-1-loops"), "1");
  EXPECT_EQ(cell("t1-1-meetings"), "3");
  EXPECT_EQ(cell("t1-2-meetings"), "3");
  EXPECT_EQ(cell("t1-3-meetings"), "0");
  EXPECT_EQ(cell("t1-3-loops"), "0");  // its one encounter was refused
  EXPECT_EQ(cell("t1-2-read"), "400");
  EXPECT_EQ(cell("t1-2-dropped"), "2");
  EXPECT_EQ(cell("t1-all-poses"), "265");
  EXPECT_EQ(cell("t1-all-meetings"), "3");
  EXPECT_EQ(cell("t1-all-loops"), "1");
  double way = 0;
  for (int k = 1; k < 60; ++k) {
    const testing::MadeSession yard{"yard", 60, 3, {}, 3};
    way += (testing::made_pose(yard, k).t - testing::made_pose(yard, k - 1).t).norm();
  }
  EXPECT_NEAR(figure("t1-3-path"), way, 0.006);
  EXPECT_EQ(cell("e-active-between"), "3");
  EXPECT_EQ(cell("e-waiting-between"), "1");
  EXPECT_EQ(cell("e-refused-within"), "1");
  EXPECT_NE(cell("refused").find("2: too few inliers (2)"), std::string::npos);
}

TEST_F(SessionReport, Table2IsMeanVarianceAndWorst) {
  const SessionReportData data = report_on_run(testing::made_run({{"a", 41, 1, {}, 4}}), {});
  make(data);
  // 20 + k for k in 0..40.
  EXPECT_EQ(cell("t2-window-count"), "41");
  EXPECT_NEAR(figure("t2-window-mean"), 40, 1e-9);
  EXPECT_NEAR(figure("t2-window-variance"), (41.0 * 41 - 1) / 12, 0.06);
  EXPECT_NEAR(figure("t2-window-worst"), 60, 1e-9);
  EXPECT_NEAR(figure("t2-place_recognition-mean"), 50, 1e-9);
  EXPECT_EQ(cell("t2-stereo_odometry-count"), "205");
  EXPECT_NEAR(figure("t2-stereo_odometry-variance"), 0, 1e-9);
  EXPECT_NEAR(figure("t2-stereo_odometry-share"), 100 * 205 * 0.004 / 10.0, 0.06);
  EXPECT_EQ(cell("t2-pose_graph-count"), "4");
  EXPECT_NEAR(figure("t2-pose_graph-mean"), 25, 1e-9);
  EXPECT_EQ(cell("t2-pose_graph_loop-count"), "1");
  EXPECT_NEAR(figure("t2-pose_graph_loop-mean"), 20, 1e-9);
  EXPECT_NEAR(figure("t2-pose_graph_no_loop-mean"), 80.0 / 3, 1e-3);
  EXPECT_EQ(times_of_module(data, SessionModule::window).worst_at, (PoseKey{1, 40}));
  // The paper's, as the paper prints them.
  const std::string table = cell("table2");
  for (const char* paper : {"170.3", "8.32e+04", "99.6", "196.0", "32.9", "4000"})
    EXPECT_NE(table.find(paper), std::string::npos) << paper;
  EXPECT_NE(page_.find("another machine"), std::string::npos);
}

TEST_F(SessionReport, EveryDotIsWhereItsNumberIs) {
  make(report_on_run(testing::made_run(), {}));
  const std::vector<std::pair<std::string, int>> sessions{{"hall", 125}, {"stairs & <b>", 80}, {"yard", 60}};
  double offset = 0, seconds = 0, spent_window = 0, spent_odometry = 0;
  std::vector<CanvasPoint> window_so_far{{0, 0}}, odometry_so_far{{0, 0}}, loops, plain;
  for (const auto& [name, poses] : sessions) {
    std::vector<CanvasPoint> window, place;
    for (int k = 0; k < poses; ++k) {
      window.push_back({offset + k, 20.0 + k});
      place.push_back({offset + k, 30.0 + k});
      if (k % 10 == 0 && k > 0) (k == 20 ? loops : plain).push_back({offset + k, 1.0 * k});
      window_so_far.push_back({seconds + 0.25 * k, spent_window += 0.001 * (20 + k)});
      for (int f = 5 * k; f < 5 * k + 5; ++f)
        odometry_so_far.push_back({seconds + std::min(0.05 * f, 0.25 * (poses - 1)), spent_odometry += 0.004});
    }
    expect_shown("window", name, window);
    expect_shown("place", name, place);
    offset += poses;
    seconds += 0.25 * (poses - 1);
  }
  expect_shown("graph", "a loop was closed", loops);
  expect_shown("graph", "no loop", plain);
  expect_shown("front", "windowed bundle adjustment", window_so_far);
  expect_shown("front", "stereo odometry", odometry_so_far);
  expect_shown("front", "real time", {{0, 0}, {seconds, seconds}});
  ASSERT_FALSE(shown("back", "place recognition").empty());
  EXPECT_NEAR(shown("back", "pose graph").back().y, 0.78 + 0.28 + 0.15, 0.05);
}

TEST_F(SessionReport, MapsAreInIt) {
  make(report_on_run(testing::made_run(), {}));
  std::set<std::string> maps;
  for (const Element* svg : root_->all("svg")) {
    if (svg->attribute("data-map").empty()) continue;
    maps.insert(svg->attribute("data-map"));
    EXPECT_GT(svg->all("polyline").size(), 1U);
  }
  EXPECT_EQ(maps, (std::set<std::string>{"above", "elevation", "session-1", "session-2", "session-3", "side"}));
  EXPECT_NE(page_.find("Not all sessions have met"), std::string::npos);
  EXPECT_EQ(page_.find("<script"), std::string::npos);
  EXPECT_TRUE(root_->all("link").empty());
  for (const Element* image : root_->all("image"))
    EXPECT_EQ(image->attribute("href").rfind("data:image/png;base64,", 0), 0U);
}

TEST_F(SessionReport, HostileNamesAreText) {
  SlamSessionsResult run = testing::made_run();
  run.view.sessions[2].start.name = "</td><script>alert(1)</script>\"'&\x01\xff\xe2\x82";
  run.view.sessions[2].start.source = "a\xed\xa0\x80 b \xf0\x9f\x98\x80";
  make(report_on_run(run, {}));
  EXPECT_TRUE(root_->all("script").empty());
  const std::string table = cell("table1");
  EXPECT_NE(table.find("</td><script>alert(1)</script>\"'&\uFFFD\uFFFD\uFFFD\uFFFD"), std::string::npos);
  EXPECT_NE(table.find("a\uFFFD\uFFFD\uFFFD b \xf0\x9f\x98\x80"), std::string::npos);
  EXPECT_NE(cell("warnings").find("stairs & <b>: frame 7: \"dark\" & <odd>"), std::string::npos);
}

TEST_F(SessionReport, TwoHundredEncountersAreListedThoseInTheGraphFirst) {
  SlamSessionsResult run = testing::made_run();
  run.view.encounters.clear();
  for (int i = 1; i <= 250; ++i)
    run.view.encounters.push_back(testing::made_encounter(i, {1, i % 100}, {2, i % 70},
                                                          i > 240 ? EncounterState::active : EncounterState::off, run));
  run.view.encounters[249].crf_far = 1.5;
  make(report_on_run(run, {}));
  const auto rows = ids_.at("encounters")->all("tr");
  ASSERT_EQ(rows.size(), 201U);
  EXPECT_EQ(rows[1]->all("td")[0]->text, "241");
  const auto last_active = rows[10]->all("td");
  EXPECT_EQ(last_active[0]->text, "250");
  EXPECT_EQ(last_active[2]->text, "hall : 50");
  EXPECT_EQ(last_active[3]->text, "stairs & <b> : 40");
  EXPECT_EQ(last_active[4]->text, "0.500");
  EXPECT_EQ(last_active[5]->text, "1.25");
  EXPECT_EQ(last_active[6]->text, "1.5");
  EXPECT_EQ(last_active[8]->text, "60");
  EXPECT_NEAR(std::strtod(last_active[10]->text.c_str(), nullptr), 0.02 * std::sqrt(3.0), 6e-4);
  EXPECT_EQ(rows[11]->all("td")[0]->text, "1");
  EXPECT_EQ(rows[1]->all("td")[6]->text, "not asked");
  EXPECT_EQ(cell("more"), "and 50 more.");
}

TEST_F(SessionReport, WhatIsNotKnownIsSaidSo) {
  SlamSessionsResult run = testing::made_run({{"a", 41, 1, {}, 4}});
  std::erase_if(run.timings, [](const SessionTiming& t) { return t.module == SessionModule::place_recognition; });
  SessionReportData data = report_on_run(run, {});
  data.frames.clear();
  data.settings.clear();
  data.warnings_known = data.refused_places_known = false;
  make(data);
  EXPECT_EQ(cell("t2-place_recognition-mean"), "not known");
  EXPECT_EQ(cell("t1-1-read"), "not known");
  for (const char* text : {"Times of place recognition: not known", "Settings: not known",
                           "Warnings of the run: not known", "itself refused: not known"})
    EXPECT_NE(page_.find(text), std::string::npos) << text;
  // The back end was elsewhere: what the front end knows is told.
  run.view = {};
  run.timings.clear();
  make(report_on_run(run, {}));
  EXPECT_EQ(cell("t1-1-poses"), "41");
  EXPECT_EQ(cell("t2-pose_graph-mean"), "not known");
  EXPECT_NE(page_.find("The back end was another process"), std::string::npos);
  // Nothing at all.
  make(report_on_run({}, {}));
  EXPECT_NE(page_.find("there is no map"), std::string::npos);
}

TEST_F(SessionReport, OfADatabaseWithImagesTheMapsAreTextured) {
  const testing::ScratchFolder folder;
  const std::string path = folder.file("sessions.db");
  const StereoCamera camera{128, 96, {95, 95}, {63.5, 47.5}, 0.12};
  {
    SessionDatabase database(path, SqliteMode::write, "test");
    SessionStart start{"hall", "recordings/hall", camera, {}, 20};
    const SessionState state = database.begin_session(start);
    SessionBatch batch;
    batch.session = state.id;
    cv::Mat1b wall(96, 160);
    cv::RNG random(7);
    random.fill(wall, cv::RNG::UNIFORM, 0, 256);
    for (int k = 0; k < 6; ++k) {
      // A wall at 1.14 m: ten pixels of disparity; each step aside moves it by four.
      SessionBatch::NewKeyframe added;
      added.keyframe = {k,  5 * k, from_seconds(0.25 * k), false, {Eigen::Matrix3d::Identity(), {0.048 * k, 0, 0}},
                        {}, {}};
      added.keyframe.left = GreyImage(wall(cv::Rect(4 * k, 0, 128, 96)).clone());
      added.keyframe.right = GreyImage(wall(cv::Rect(4 * k + 10, 0, 128, 96)).clone());
      batch.keyframes.push_back(added);
      if (k > 0) {
        SessionWindow window;
        window.constraints.push_back(
            {k - 1, k, {Eigen::Matrix3d::Identity(), {0.048, 0, 0}}, testing::made_covariance(0.01, 0.002), false});
        batch.windows.push_back(window);
      }
      batch.timings.push_back({{state.id, k}, SessionModule::window, 7.5, false});
    }
    database.save(batch);
  }
  write_session_report(path, folder.file("report.html"));
  SessionDatabase database(path, SqliteMode::read);
  const SessionReportData data = report_on_database(&database);
  make(data);
  EXPECT_EQ(testing::read_all(folder.file("report.html")), page_);
  EXPECT_EQ(cell("t1-1-poses"), "6");
  EXPECT_NEAR(figure("t2-window-mean"), 7.5, 1e-9);
  EXPECT_EQ(data.scene.spreads.size(), 6U);
  ASSERT_TRUE(data.scene.sessions[0].textured);
  int on_wall = 0;
  for (const ColouredPoint& p : data.scene.sessions[0].points) on_wall += std::abs(p.position.z() - 1.14F) < 0.05F;
  EXPECT_GT(on_wall, 100);
  EXPECT_EQ(on_wall, static_cast<int>(data.scene.sessions[0].points.size()));
  EXPECT_THROW(write_session_report(folder.write("other.db", "no database"), folder.file("r.html")), InputError);
  EXPECT_THROW(write_session_report(path, folder.file("no/such/r.html")), RunError);
}

}  // namespace
}  // namespace parallax

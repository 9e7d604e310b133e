// Messages between processes: every number to the last bit, and nothing that is out of its bounds.
#include "sessions/lcm_messages.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <bit>
#include <opencv2/core.hpp>
#include <random>

#include "core/error.h"
#include "tests/sessions/simulated_network.h"

namespace parallax {
namespace {

using testing::bytes_of;

const StereoCamera kMessageCamera{48, 40, {30.5, 30.25}, {23.1, 19.9}, 0.12};

RigidTransform odd_pose(double k) {
  Vector6d mu;
  mu << k, -2 * k, 0.1, 0.3 * k, -0.2, 0.7;
  return RigidTransform::exp(mu);
}

Matrix6d odd_covariance(double k) {
  Matrix6d a = Matrix6d::Identity() * k;
  a(0, 3) = a(3, 0) = 0.1 * k;
  a(2, 5) = a(5, 2) = -0.3 * k;
  return a;
}

BeginMessage some_begin() {
  BeginMessage out;
  out.start.name = "a name";
  out.start.source = "recordings/hall \xc3\xa4";
  out.start.camera = kMessageCamera;
  out.start.rectified_from_left = odd_pose(0.01);
  out.start.frames_per_second = 20;
  out.session = 3;
  out.resume = true;
  return out;
}

KeyframeMessage some_keyframe() {
  KeyframeMessage out;
  out.number = 5;
  out.keyframe.index = 7;
  out.keyframe.frame = 31;
  out.keyframe.time = Timestamp(1234567890123456789);
  out.keyframe.after_failure = true;
  out.keyframe.session_from_camera = odd_pose(1.7);
  std::mt19937 rng(4);
  out.keyframe.left = GreyImage(40, 48);
  out.keyframe.right = GreyImage(40, 48);
  for (std::uint8_t& p : out.keyframe.left) p = static_cast<std::uint8_t>(rng());
  for (std::uint8_t& p : out.keyframe.right) p = static_cast<std::uint8_t>(rng() % 16);
  return out;
}

WindowMessage some_window() {
  WindowMessage out;
  out.number = 6;
  out.window.constraints.push_back({6, 7, odd_pose(0.3), odd_covariance(1e-4), false});
  out.window.constraints.push_back({7, 8, odd_pose(-0.3), odd_covariance(1e-3), true});
  out.window.points.push_back({6, {1.5f, -2.25f, 8.f}, 4});
  return out;
}

template <class Message>
Message read_again(const std::string& bytes) {
  FrontEndMessageReader reader;
  return std::get<Message>(reader.read(bytes_of(bytes), &kMessageCamera));
}

template <class Message>
Message read_back_again(const Message& message) {
  return std::get<Message>(read_back_end_message(bytes_of(encode(message))));
}

TEST(LcmMessages, FrontEndMessagesComeBackToTheLastBit) {
  const BeginMessage begin = some_begin(), begun = read_again<BeginMessage>(encode(begin));
  EXPECT_EQ(begun.start.name, begin.start.name);
  EXPECT_EQ(begun.start.source, begin.start.source);
  EXPECT_EQ(begun.start.camera, begin.start.camera);
  EXPECT_EQ(begun.start.rectified_from_left.R, begin.start.rectified_from_left.R);
  EXPECT_EQ(begun.start.rectified_from_left.t, begin.start.rectified_from_left.t);
  EXPECT_EQ(begun.start.frames_per_second, 20);
  EXPECT_EQ(begun.session, 3);
  EXPECT_TRUE(begun.resume && !begun.again);

  ImageCodec codec;
  const KeyframeMessage sent = some_keyframe(), got = read_again<KeyframeMessage>(encode(sent, &codec));
  EXPECT_EQ(got.number, 5);
  EXPECT_EQ(got.keyframe.index, 7);
  EXPECT_EQ(got.keyframe.frame, 31);
  EXPECT_EQ(got.keyframe.time, sent.keyframe.time);
  EXPECT_TRUE(got.keyframe.after_failure);
  EXPECT_EQ(got.keyframe.session_from_camera.R, sent.keyframe.session_from_camera.R);
  EXPECT_EQ(got.keyframe.session_from_camera.t, sent.keyframe.session_from_camera.t);
  EXPECT_EQ(cv::norm(got.keyframe.left, sent.keyframe.left, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(got.keyframe.right, sent.keyframe.right, cv::NORM_INF), 0);

  const WindowMessage window = some_window(), same = read_again<WindowMessage>(encode(window));
  ASSERT_EQ(same.window.constraints.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    const StereoConstraint &a = window.window.constraints[i], &b = same.window.constraints[i];
    EXPECT_EQ(a.from, b.from);
    EXPECT_EQ(a.to, b.to);
    EXPECT_EQ(a.after_failure, b.after_failure);
    EXPECT_EQ(a.from_from_to.R, b.from_from_to.R);
    EXPECT_EQ(a.from_from_to.t, b.from_from_to.t);
    EXPECT_EQ(a.covariance, b.covariance);
  }
  ASSERT_EQ(same.window.points.size(), 1u);
  EXPECT_EQ(same.window.points[0].camera, window.window.points[0].camera);
  EXPECT_EQ(same.window.points[0].poses, 4);

  const TimingsMessage timings{
      9, {{{0, 7}, SessionModule::pose_graph, 1.25, true}, {{0, 8}, SessionModule::window, 3, false}}};
  const TimingsMessage timed = read_again<TimingsMessage>(encode(timings));
  ASSERT_EQ(timed.timings.size(), 2u);
  EXPECT_EQ(timed.timings[0].key.keyframe, 7);
  EXPECT_EQ(timed.timings[0].module, SessionModule::pose_graph);
  EXPECT_EQ(timed.timings[0].ms, 1.25);
  EXPECT_TRUE(timed.timings[0].loop);
  EXPECT_EQ(read_again<EndMessage>(encode(EndMessage{12})).number, 12);
}

TEST(LcmMessages, BackEndMessagesComeBackToTheLastBit) {
  BegunMessage begun{4, 2, "hall-2", odd_pose(0.5), odd_covariance(0.01), SessionPose()};
  begun.last->key = {4, 88};
  begun.last->frame = 352;
  begun.last->time = Timestamp(-5);
  begun.last->session_from_camera = odd_pose(2);
  const BegunMessage same = read_back_again(begun);
  EXPECT_EQ(same.session, 4);
  EXPECT_EQ(same.component, 2);
  EXPECT_EQ(same.name, "hall-2");
  EXPECT_EQ(same.global_from_session.R, begun.global_from_session.R);
  EXPECT_EQ(same.anchor_covariance, begun.anchor_covariance);
  EXPECT_EQ(same.last->key, begun.last->key);
  EXPECT_EQ(same.last->frame, 352);
  EXPECT_EQ(same.last->time.count(), -5);
  EXPECT_EQ(same.last->session_from_camera.t, begun.last->session_from_camera.t);
  begun.last.reset();
  EXPECT_FALSE(read_back_again(begun).last);

  AnswerMessage answer{41, BackEndAnswer()};
  answer.answer->keyframes = 90;
  answer.answer->in_graph = 85;
  answer.answer->loop = true;
  answer.answer->component = 1;
  answer.answer->global_from_session = odd_pose(3);
  answer.answer->meetings.push_back({{}, "third floor"});
  Encounter& meeting = answer.answer->meetings[0].encounter;
  meeting.id = 1LL << 40;
  meeting.found = {1, 12};
  meeting.query = {4, 89};
  meeting.found_from_query = odd_pose(-1);
  meeting.covariance = odd_covariance(0.02);
  meeting.bow = 0.9;
  meeting.crf_near = 2.5;
  meeting.matches = 80;
  meeting.inliers = 61;
  meeting.state = EncounterState::active;
  const AnswerMessage got = read_back_again(answer);
  EXPECT_EQ(got.number, 41);
  ASSERT_TRUE(got.answer);
  EXPECT_EQ(got.answer->keyframes, 90);
  EXPECT_EQ(got.answer->in_graph, 85);
  EXPECT_TRUE(got.answer->loop);
  EXPECT_EQ(got.answer->global_from_session.R, answer.answer->global_from_session.R);
  ASSERT_EQ(got.answer->meetings.size(), 1u);
  EXPECT_EQ(got.answer->meetings[0].other, "third floor");
  const Encounter& e = got.answer->meetings[0].encounter;
  EXPECT_EQ(e.id, meeting.id);
  EXPECT_EQ(e.found, meeting.found);
  EXPECT_EQ(e.query, meeting.query);
  EXPECT_EQ(e.found_from_query.R, meeting.found_from_query.R);
  EXPECT_EQ(e.covariance, meeting.covariance);
  EXPECT_EQ(e.crf_near, 2.5);
  EXPECT_EQ(std::bit_cast<std::uint64_t>(e.crf_far), std::bit_cast<std::uint64_t>(meeting.crf_far)) << "NaN: not asked";
  EXPECT_EQ(e.inliers, 61);
  EXPECT_EQ(e.state, EncounterState::active);
  EXPECT_FALSE(read_back_again(AnswerMessage{42, {}}).answer);
  EXPECT_EQ(read_back_again(SavedMessage{17, 30}).in_graph, 30);
  const RefusalMessage refusal = read_back_again(RefusalMessage{RefusalReason::busy, "not\nnow"});
  EXPECT_EQ(refusal.reason, RefusalReason::busy);
  EXPECT_EQ(refusal.text, "not now");
}

std::string refusal_of(const std::string& bytes, const StereoCamera* camera = &kMessageCamera) {
  FrontEndMessageReader reader;
  try {
    reader.read(bytes_of(bytes), camera);
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    return e.what();
  }
  return {};
}

TEST(LcmMessages, WhatIsOutOfItsBoundsIsRefused) {
  ImageCodec codec;
  const auto begin = [](const auto& change) {
    BeginMessage m = some_begin();
    change(&m);
    return refusal_of(encode(m));
  };
  EXPECT_EQ(begin([](BeginMessage*) {}), "");
  EXPECT_NE(begin([](BeginMessage* m) { m->start.name = ""; }), "");
  EXPECT_NE(begin([](BeginMessage* m) { m->start.name = "a\nb"; }), "");
  EXPECT_NE(begin([](BeginMessage* m) { m->start.name = std::string(500, 'x'); }), "");
  EXPECT_NE(begin([](BeginMessage* m) { m->session = -1; }), "");
  EXPECT_NE(begin([](BeginMessage* m) { m->start.camera.width = 1 << 20; }), "");
  EXPECT_NE(begin([](BeginMessage* m) { m->start.camera.baseline_m = 0; }), "");
  EXPECT_NE(begin([](BeginMessage* m) { m->start.camera.focal_px.x() = std::nan(""); }), "");
  EXPECT_NE(begin([](BeginMessage* m) { m->start.rectified_from_left.R(0, 0) = 2; }), "");

  const auto keyframe = [&](const auto& change) {
    KeyframeMessage m = some_keyframe();
    change(&m);
    return refusal_of(encode(m, &codec));
  };
  EXPECT_EQ(keyframe([](KeyframeMessage*) {}), "");
  EXPECT_NE(keyframe([](KeyframeMessage* m) { m->keyframe.left = GreyImage(48, 40, std::uint8_t{1}); }), "");
  EXPECT_NE(keyframe([](KeyframeMessage* m) { m->keyframe.right = GreyImage(); }), "");
  EXPECT_NE(keyframe([](KeyframeMessage* m) { m->keyframe.index = -1; }), "");
  EXPECT_NE(keyframe([](KeyframeMessage* m) { m->number = 0; }), "");
  EXPECT_NE(keyframe([](KeyframeMessage* m) { m->keyframe.session_from_camera.t.x() = INFINITY; }), "");
  EXPECT_NE(refusal_of(encode(some_keyframe(), &codec), nullptr).find("has not begun"), std::string::npos);

  const auto window = [](const auto& change) {
    WindowMessage m = some_window();
    change(&m);
    return refusal_of(encode(m));
  };
  EXPECT_EQ(window([](WindowMessage*) {}), "");
  EXPECT_NE(window([](WindowMessage* m) { m->window.constraints[1].covariance(2, 2) = -1; }), "");
  EXPECT_NE(window([](WindowMessage* m) { m->window.constraints[1].covariance(2, 1) = 1; }), "");
  EXPECT_NE(window([](WindowMessage* m) { m->window.constraints[0].from_from_to.R.setZero(); }), "");
  EXPECT_NE(window([](WindowMessage* m) { m->window.constraints[0].to = -4; }), "");
  EXPECT_NE(refusal_of(encode(TimingsMessage{1, {{{0, 1}, static_cast<SessionModule>(9), 1.0, false}}})), "");
  EXPECT_NE(refusal_of(encode(TimingsMessage{1, {{{0, 1}, SessionModule::window, -1.0, false}}})), "");
}

TEST(LcmMessages, DamagedBytesAreRefusedAndNeverCrash) {
  ImageCodec codec;
  const std::vector<std::string> sound{encode(some_begin()), encode(some_keyframe(), &codec), encode(some_window()),
                                       encode(TimingsMessage{1, {{{0, 1}, SessionModule::window, 1.0, false}}})};
  std::mt19937 rng(2);
  for (const std::string& good : sound) {
    for (int i = 0; i < 60; ++i) EXPECT_NE(refusal_of(good.substr(0, rng() % good.size())), "");
    EXPECT_NE(refusal_of(good + "x"), "");
    std::string later = good;
    later[11] = 9;
    EXPECT_NE(refusal_of(later).find("found version 9, expected 1"), std::string::npos) << refusal_of(later);
    // Lengths that are not the bytes'.
    for (const std::size_t at : {12u, 16u}) {
      std::string endless = good;
      endless[at] = '\x7f';
      EXPECT_NE(refusal_of(endless), "");
      endless[at] = '\xff';
      EXPECT_NE(refusal_of(endless), "");
    }
    for (int i = 0; i < 200; ++i) {
      std::string turned = good;
      turned[rng() % turned.size()] ^= static_cast<char>(1 << rng() % 8);
      refusal_of(turned);
    }
  }
}

}  // namespace
}  // namespace parallax

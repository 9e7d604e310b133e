#include "sessions/lcm_messages.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <parallax_messages/answer.hpp>
#include <parallax_messages/begin.hpp>
#include <parallax_messages/begun.hpp>
#include <parallax_messages/end.hpp>
#include <parallax_messages/keyframe.hpp>
#include <parallax_messages/refusal.hpp>
#include <parallax_messages/saved.hpp>
#include <parallax_messages/timings.hpp>
#include <parallax_messages/window.hpp>
#include <utility>

#include "core/error.h"
#include "sessions/lcm_codec.h"
#include "sessions/stream_datagrams.h"

namespace parallax {
namespace {

namespace wire = parallax_messages;
using Bytes = std::span<const std::uint8_t>;

constexpr int kMostIndex = 1 << 30;                        // of keyframes, frames, sessions
constexpr std::int64_t kMostTime = std::int64_t{1} << 62;  // nanoseconds: a hundred years and more

[[noreturn]] void refuse(const char* type, const std::string& found, const std::string& expected) {
  throw InputError(std::string(type) + " message: found " + found + ", expected " + expected);
}

void require(bool condition, const char* type, const char* what) {
  if (!condition) refuse(type, std::string(what) + " out of range", "one that a session can have");
}

// Of this type, of this version, and as long as it says.
template <class T, std::size_t N = 0>
T read_as(Bytes bytes, const std::array<std::size_t, N>& elements = {}) {
  T out{};
  const std::int32_t version = lcm_codec::big_endian_at(bytes, 8);
  if (version != kSessionProtocolVersion)
    refuse(T::getTypeName(), "version " + std::to_string(version), std::to_string(kSessionProtocolVersion));
  if (!lcm_codec::decode(bytes, &out, elements))
    refuse(T::getTypeName(), std::to_string(bytes.size()) + " bytes", "as many as its lengths say");
  return out;
}

template <class T>
std::size_t element_size() {
  return static_cast<std::size_t>(T{}._getEncodedSizeNoHash());
}

wire::pose to_wire(const RigidTransform& transform) {
  wire::pose out{};
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out.rotation[3 * r + c] = transform.R(r, c);
  for (int i = 0; i < 3; ++i) out.translation[i] = transform.t[i];
  return out;
}

RigidTransform from_wire(const wire::pose& in, const char* type) {
  RigidTransform out;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out.R(r, c) = in.rotation[3 * r + c];
  for (int i = 0; i < 3; ++i) out.t[i] = in.translation[i];
  const bool sound = out.R.allFinite() && out.t.allFinite() &&
                     (out.R.transpose() * out.R - Eigen::Matrix3d::Identity()).norm() < 1e-6 && out.R.determinant() > 0;
  if (!sound) refuse(type, "a pose that is none", "a rotation and a translation");
  return out;
}

void to_wire(const Matrix6d& matrix, double out[36]) {
  for (int r = 0; r < 6; ++r)
    for (int c = 0; c < 6; ++c) out[6 * r + c] = matrix(r, c);
}

// `definite`: positive definite; else semi-definite, as far as its diagonal tells.
Matrix6d covariance_from_wire(const double in[36], bool definite, const char* type) {
  Matrix6d out;
  for (int r = 0; r < 6; ++r)
    for (int c = 0; c < 6; ++c) out(r, c) = in[6 * r + c];
  const bool sound = out.allFinite() && (out - out.transpose()).norm() <= 1e-6 * out.norm() &&
                     (definite ? out.llt().info() == Eigen::Success : out.diagonal().minCoeff() >= 0);
  if (!sound) refuse(type, "a covariance that is none", "a symmetric positive matrix");
  return out;
}

std::vector<std::uint8_t> to_wire(const std::string& text) { return {text.begin(), text.end()}; }

std::string text_from_wire(const std::vector<std::uint8_t>& in, std::size_t most, const char* type) {
  if (in.size() > most)
    refuse(type, "a text of " + std::to_string(in.size()) + " bytes", std::to_string(most) + " at most");
  std::string out(in.begin(), in.end());
  if (std::any_of(in.begin(), in.end(), [](std::uint8_t c) { return c < 32 || c == 127; }))
    refuse(type, "a control character in a text", "none");
  return out;
}

std::int64_t number_from_wire(std::int64_t number, const char* type) {
  require(number > 0 && number < kMostTime, type, "a number");
  return number;
}

int index_from_wire(std::int32_t index, const char* type) {
  require(index >= 0 && index <= kMostIndex, type, "an index");
  return index;
}

Timestamp time_from_wire(std::int64_t time, const char* type) {
  require(time > -kMostTime && time < kMostTime, type, "a time");
  return Timestamp(time);
}

BeginMessage read_begin(Bytes bytes) {
  constexpr const char* kType = "begin";
  const auto in = read_as<wire::begin, 2>(bytes, {1, 1});
  BeginMessage out;
  out.start.name = text_from_wire(in.name, 200, kType);
  require(!out.start.name.empty(), kType, "a name");
  out.start.source = text_from_wire(in.source, 4096, kType);
  out.session = index_from_wire(in.session, kType);
  out.resume = in.resume != 0;
  out.again = in.again != 0;
  StereoCamera& camera = out.start.camera;
  camera.width = in.width;
  camera.height = in.height;
  camera.focal_px = {in.focal_px[0], in.focal_px[1]};
  camera.centre_px = {in.centre_px[0], in.centre_px[1]};
  camera.baseline_m = in.baseline_m;
  require(camera.width >= 16 && camera.width <= 16384 && camera.height >= 16 && camera.height <= 16384, kType,
          "an image size");
  require(camera.focal_px.allFinite() && camera.focal_px.minCoeff() > 0 && camera.focal_px.maxCoeff() < 1e6 &&
              camera.centre_px.allFinite() && camera.centre_px.cwiseAbs().maxCoeff() < 1e6 &&
              std::isfinite(camera.baseline_m) && camera.baseline_m > 0 && camera.baseline_m < 1e3,
          kType, "a camera");
  out.start.frames_per_second = in.frames_per_second;
  require(std::isfinite(in.frames_per_second) && in.frames_per_second >= 0 && in.frames_per_second < 1e6, kType,
          "a frame rate");
  out.start.rectified_from_left = from_wire(in.rectified_from_left, kType);
  return out;
}

KeyframeMessage read_keyframe(Bytes bytes, const StereoCamera& camera, ImageCodec* codec) {
  constexpr const char* kType = "keyframe";
  const auto in = read_as<wire::keyframe, 2>(bytes, {1, 1});
  KeyframeMessage out;
  out.number = number_from_wire(in.number, kType);
  out.keyframe.index = index_from_wire(in.index, kType);
  out.keyframe.frame = index_from_wire(in.frame, kType);
  out.keyframe.time = time_from_wire(in.time, kType);
  out.keyframe.after_failure = in.after_failure != 0;
  out.keyframe.session_from_camera = from_wire(in.session_from_camera, kType);
  const cv::Size size(in.width, in.height);
  if (size != cv::Size(camera.width, camera.height))
    refuse(kType, "images of " + std::to_string(in.width) + " x " + std::to_string(in.height) + " pixels",
           std::to_string(camera.width) + " x " + std::to_string(camera.height));
  if (!codec->unpack_grey(in.left, size, &out.keyframe.left) ||
      !codec->unpack_grey(in.right, size, &out.keyframe.right))
    refuse(kType, "images that do not unpack", "two that do");
  return out;
}

WindowMessage read_window(Bytes bytes) {
  constexpr const char* kType = "window";
  const auto in = read_as<wire::window, 2>(bytes, {element_size<wire::constraint>(), element_size<wire::point>()});
  WindowMessage out;
  out.number = number_from_wire(in.number, kType);
  out.window.constraints.reserve(in.constraints.size());
  for (const wire::constraint& c : in.constraints) {
    StereoConstraint& added = out.window.constraints.emplace_back();
    added.from = index_from_wire(c.from, kType);
    added.to = index_from_wire(c.to, kType);
    added.after_failure = c.after_failure != 0;
    added.from_from_to = from_wire(c.from_from_to, kType);
    added.covariance = covariance_from_wire(c.covariance, true, kType);
  }
  out.window.points.reserve(in.points.size());
  // Points at infinity have no coordinates: the back end passes them over.
  for (const wire::point& p : in.points)
    out.window.points.push_back(
        {index_from_wire(p.keyframe, kType), {p.camera[0], p.camera[1], p.camera[2]}, index_from_wire(p.poses, kType)});
  return out;
}

TimingsMessage read_timings(Bytes bytes) {
  constexpr const char* kType = "timings";
  const auto in = read_as<wire::timings, 1>(bytes, {element_size<wire::timing>()});
  TimingsMessage out;
  out.number = number_from_wire(in.number, kType);
  for (const wire::timing& t : in.rows) {
    require(t.module >= 0 && t.module <= static_cast<int>(SessionModule::pose_graph), kType, "a module");
    require(std::isfinite(t.ms) && t.ms >= 0, kType, "a time");
    require(t.keyframe >= -1 && t.keyframe <= kMostIndex, kType, "an index");
    out.timings.push_back(
        {{index_from_wire(t.session, kType), t.keyframe}, static_cast<SessionModule>(t.module), t.ms, t.loop != 0});
  }
  return out;
}

wire::encounter to_wire(const Encounter& in) {
  wire::encounter out{};
  out.id = in.id;
  out.found_session = in.found.session;
  out.found_keyframe = in.found.keyframe;
  out.query_session = in.query.session;
  out.query_keyframe = in.query.keyframe;
  out.found_from_query = to_wire(in.found_from_query);
  to_wire(in.covariance, out.covariance);
  out.bow = in.bow;
  out.crf_near = in.crf_near;
  out.crf_far = in.crf_far;
  out.matches = in.matches;
  out.inliers = in.inliers;
  out.state = static_cast<std::int32_t>(in.state);
  return out;
}

Encounter from_wire(const wire::encounter& in, const char* type) {
  Encounter out;
  out.id = in.id;
  out.found = {index_from_wire(in.found_session, type), index_from_wire(in.found_keyframe, type)};
  out.query = {index_from_wire(in.query_session, type), index_from_wire(in.query_keyframe, type)};
  out.found_from_query = from_wire(in.found_from_query, type);
  out.covariance = covariance_from_wire(in.covariance, true, type);
  out.bow = in.bow;
  out.crf_near = in.crf_near;  // NaN: was not asked
  out.crf_far = in.crf_far;
  out.matches = index_from_wire(in.matches, type);
  out.inliers = index_from_wire(in.inliers, type);
  require(in.state >= 0 && in.state <= static_cast<int>(EncounterState::off), type, "a state");
  out.state = static_cast<EncounterState>(in.state);
  return out;
}

BegunMessage read_begun(Bytes bytes) {
  constexpr const char* kType = "begun";
  const auto in = read_as<wire::begun, 1>(bytes, {1});
  BegunMessage out;
  out.session = index_from_wire(in.session, kType);
  out.component = index_from_wire(in.component, kType);
  require(out.session > 0, kType, "a session");
  out.name = text_from_wire(in.name, 300, kType);
  out.global_from_session = from_wire(in.global_from_session, kType);
  out.anchor_covariance = covariance_from_wire(in.anchor_covariance, false, kType);
  if (in.has_last) {
    SessionPose last;
    last.key = {out.session, index_from_wire(in.last_index, kType)};
    last.frame = index_from_wire(in.last_frame, kType);
    last.time = time_from_wire(in.last_time, kType);
    last.after_failure = in.last_after_failure != 0;
    last.session_from_camera = from_wire(in.last_session_from_camera, kType);
    out.last = last;
  }
  return out;
}

AnswerMessage read_answer(Bytes bytes) {
  constexpr const char* kType = "answer";
  const auto in = read_as<wire::answer, 2>(bytes, {element_size<wire::encounter>(), 1});
  AnswerMessage out;
  out.number = number_from_wire(in.number, kType);
  if (!in.has_answer) return out;
  BackEndAnswer answer;
  answer.keyframes = index_from_wire(in.keyframes, kType);
  answer.in_graph = index_from_wire(in.in_graph, kType);
  answer.loop = in.loop != 0;
  answer.component = index_from_wire(in.component, kType);
  answer.global_from_session = from_wire(in.global_from_session, kType);
  auto name = in.others.begin();
  for (const wire::encounter& meeting : in.meetings) {
    const auto end = std::find(name, in.others.end(), '\n');
    require(end != in.others.end(), kType, "a name");
    answer.meetings.push_back({from_wire(meeting, kType), text_from_wire({name, end}, 300, kType)});
    name = end + 1;
  }
  require(name == in.others.end(), kType, "a name");
  out.answer = std::move(answer);
  return out;
}

RefusalMessage read_refusal(Bytes bytes) {
  constexpr const char* kType = "refusal";
  const auto in = read_as<wire::refusal, 1>(bytes, {1});
  require(in.reason >= 0 && in.reason <= static_cast<int>(RefusalReason::replaced), kType, "a reason");
  return {static_cast<RefusalReason>(in.reason), text_from_wire(in.text, 1000, kType)};
}

[[noreturn]] void refuse_kind(Bytes bytes) {
  throw InputError("message: found " + std::to_string(bytes.size()) +
                   " bytes of a kind that is not known, expected one of protocol version " +
                   std::to_string(kSessionProtocolVersion));
}

}  // namespace

std::string encode(const BeginMessage& message) {
  wire::begin out{};
  const SessionStart& start = message.start;
  out.version = kSessionProtocolVersion;
  out.session = message.session;
  out.resume = message.resume;
  out.again = message.again;
  out.width = start.camera.width;
  out.height = start.camera.height;
  for (int i = 0; i < 2; ++i) {
    out.focal_px[i] = start.camera.focal_px[i];
    out.centre_px[i] = start.camera.centre_px[i];
  }
  out.baseline_m = start.camera.baseline_m;
  out.frames_per_second = start.frames_per_second;
  out.rectified_from_left = to_wire(start.rectified_from_left);
  out.name = to_wire(start.name);
  out.name_size = static_cast<std::int32_t>(out.name.size());
  out.source = to_wire(start.source);
  out.source_size = static_cast<std::int32_t>(out.source.size());
  return lcm_codec::encode(out);
}

std::string encode(const KeyframeMessage& message, ImageCodec* codec) {
  wire::keyframe out{};
  const SessionKeyframe& keyframe = message.keyframe;
  out.version = kSessionProtocolVersion;
  out.number = message.number;
  out.index = keyframe.index;
  out.frame = keyframe.frame;
  out.time = keyframe.time.count();
  out.after_failure = keyframe.after_failure;
  out.session_from_camera = to_wire(keyframe.session_from_camera);
  out.width = keyframe.left.cols;
  out.height = keyframe.left.rows;
  std::string packed;
  codec->pack_grey(keyframe.left, &packed);
  out.left = to_wire(packed);
  packed.clear();
  codec->pack_grey(keyframe.right, &packed);
  out.right = to_wire(packed);
  out.left_size = static_cast<std::int32_t>(out.left.size());
  out.right_size = static_cast<std::int32_t>(out.right.size());
  return lcm_codec::encode(out);
}

std::string encode(const WindowMessage& message) {
  wire::window out{};
  out.version = kSessionProtocolVersion;
  out.number = message.number;
  for (const StereoConstraint& c : message.window.constraints) {
    wire::constraint& added = out.constraints.emplace_back();
    added.from = c.from;
    added.to = c.to;
    added.after_failure = c.after_failure;
    added.from_from_to = to_wire(c.from_from_to);
    to_wire(c.covariance, added.covariance);
  }
  for (const SessionPoint& p : message.window.points) {
    wire::point& added = out.points.emplace_back();
    added.keyframe = p.keyframe;
    for (int i = 0; i < 3; ++i) added.camera[i] = p.camera[i];
    added.poses = p.poses;
  }
  out.constraint_count = static_cast<std::int32_t>(out.constraints.size());
  out.point_count = static_cast<std::int32_t>(out.points.size());
  return lcm_codec::encode(out);
}

std::string encode(const TimingsMessage& message) {
  wire::timings out{};
  out.version = kSessionProtocolVersion;
  out.number = message.number;
  for (const SessionTiming& t : message.timings) {
    wire::timing& added = out.rows.emplace_back();
    added.session = t.key.session;
    added.keyframe = t.key.keyframe;
    added.module = static_cast<std::int32_t>(t.module);
    added.ms = t.ms;
    added.loop = t.loop;
  }
  out.count = static_cast<std::int32_t>(out.rows.size());
  return lcm_codec::encode(out);
}

std::string encode(const EndMessage& message) {
  wire::end out{};
  out.version = kSessionProtocolVersion;
  out.number = message.number;
  return lcm_codec::encode(out);
}

std::string encode(const BegunMessage& message) {
  wire::begun out{};
  out.version = kSessionProtocolVersion;
  out.session = message.session;
  out.component = message.component;
  out.name = to_wire(message.name);
  out.name_size = static_cast<std::int32_t>(out.name.size());
  out.global_from_session = to_wire(message.global_from_session);
  to_wire(message.anchor_covariance, out.anchor_covariance);
  out.last_session_from_camera = to_wire(RigidTransform());
  if (message.last) {
    out.has_last = 1;
    out.last_index = message.last->key.keyframe;
    out.last_frame = message.last->frame;
    out.last_time = message.last->time.count();
    out.last_after_failure = message.last->after_failure;
    out.last_session_from_camera = to_wire(message.last->session_from_camera);
  }
  return lcm_codec::encode(out);
}

std::string encode(const AnswerMessage& message) {
  wire::answer out{};
  out.version = kSessionProtocolVersion;
  out.number = message.number;
  out.global_from_session = to_wire(RigidTransform());
  if (const auto& answer = message.answer) {
    out.has_answer = 1;
    out.keyframes = answer->keyframes;
    out.in_graph = answer->in_graph;
    out.loop = answer->loop;
    out.component = answer->component;
    out.global_from_session = to_wire(answer->global_from_session);
    for (const SessionMeeting& meeting : answer->meetings) {
      out.meetings.push_back(to_wire(meeting.encounter));
      out.others.insert(out.others.end(), meeting.other.begin(), meeting.other.end());
      out.others.push_back('\n');
    }
    out.others_size = static_cast<std::int32_t>(out.others.size());
    out.meeting_count = static_cast<std::int32_t>(out.meetings.size());
  }
  return lcm_codec::encode(out);
}

std::string encode(const SavedMessage& message) {
  wire::saved out{};
  out.version = kSessionProtocolVersion;
  out.number = message.number;
  out.in_graph = message.in_graph;
  return lcm_codec::encode(out);
}

std::string encode(const RefusalMessage& message) {
  wire::refusal out{};
  out.version = kSessionProtocolVersion;
  out.reason = static_cast<std::int32_t>(message.reason);
  std::string text = message.text.substr(0, 1000);
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 32 || c == 127; }, ' ');
  out.text = to_wire(text);
  out.text_size = static_cast<std::int32_t>(out.text.size());
  return lcm_codec::encode(out);
}

FrontEndMessage FrontEndMessageReader::read(Bytes bytes, const StereoCamera* camera) {
  if (lcm_codec::is_a<wire::begin>(bytes)) return read_begin(bytes);
  const bool is_keyframe = lcm_codec::is_a<wire::keyframe>(bytes), is_window = lcm_codec::is_a<wire::window>(bytes),
             is_timings = lcm_codec::is_a<wire::timings>(bytes), is_end = lcm_codec::is_a<wire::end>(bytes);
  if (!is_keyframe && !is_window && !is_timings && !is_end) refuse_kind(bytes);
  if (!camera) throw InputError("message: found one of a session that has not begun, expected its beginning");
  if (is_keyframe) return read_keyframe(bytes, *camera, &codec_);
  if (is_window) return read_window(bytes);
  if (is_timings) return read_timings(bytes);
  return EndMessage{number_from_wire(read_as<wire::end>(bytes).number, "end")};
}

BackEndMessage read_back_end_message(Bytes bytes) {
  if (lcm_codec::is_a<wire::answer>(bytes)) return read_answer(bytes);
  if (lcm_codec::is_a<wire::saved>(bytes)) {
    const auto in = read_as<wire::saved>(bytes);
    return SavedMessage{number_from_wire(in.number, "saved"), index_from_wire(in.in_graph, "saved")};
  }
  if (lcm_codec::is_a<wire::begun>(bytes)) return read_begun(bytes);
  if (lcm_codec::is_a<wire::refusal>(bytes)) return read_refusal(bytes);
  refuse_kind(bytes);
}

}  // namespace parallax

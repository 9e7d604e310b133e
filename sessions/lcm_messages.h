// What front ends and the back end tell each other (sessions/lcm/session.lcm): the values of
// sessions/session_types.h as the bytes that travel in streams (sessions/reliable_stream.h), and back.
//
// Bytes may come from anywhere: the read functions throw an InputError of one line ("keyframe message: found ...,
// expected ...") unless the version, every length and every number is right. Images are packed without loss; all
// numbers arrive to the last bit. Plain functions, safe from any thread; the reader keeps a codec and belongs to one.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "core/image_codec.h"
#include "sessions/back_end_link.h"

namespace parallax {

// Front end to back end. `number` counts what a front end has to say after its begin, from 1.
struct BeginMessage {
  SessionStart start;
  int session = 0;  // above 0: it was begun before, and this is its name
  bool resume = false;
  bool again = false;  // another back end was asked before
};
struct KeyframeMessage {
  std::int64_t number = 0;
  SessionKeyframe keyframe;
};
struct WindowMessage {
  std::int64_t number = 0;
  SessionWindow window;
};
struct TimingsMessage {
  std::int64_t number = 0;
  std::vector<SessionTiming> timings;
};
struct EndMessage {
  std::int64_t number = 0;
};
using FrontEndMessage = std::variant<BeginMessage, KeyframeMessage, WindowMessage, TimingsMessage, EndMessage>;

// Back end to front end.
struct BegunMessage {
  int session = 0, component = 0;
  std::string name;
  RigidTransform global_from_session;
  Matrix6d anchor_covariance = Matrix6d::Zero();
  std::optional<SessionPose> last;
};
struct AnswerMessage {
  std::int64_t number = 0;  // of the message that has been worked on
  std::optional<BackEndAnswer> answer;
};
struct SavedMessage {
  std::int64_t number = 0;
  int in_graph = 0;
};
enum class RefusalReason {
  busy,      // another front end has the session: may be asked again
  input,     // what was sent is wrong
  replaced,  // another front end has taken the session over
};
struct RefusalMessage {
  RefusalReason reason = RefusalReason::input;
  std::string text;
};
using BackEndMessage = std::variant<BegunMessage, AnswerMessage, SavedMessage, RefusalMessage>;

std::string encode(const BeginMessage& message);
std::string encode(const KeyframeMessage& message, ImageCodec* codec);
std::string encode(const WindowMessage& message);
std::string encode(const TimingsMessage& message);
std::string encode(const EndMessage& message);
std::string encode(const BegunMessage& message);
std::string encode(const AnswerMessage& message);
std::string encode(const SavedMessage& message);
std::string encode(const RefusalMessage& message);

class FrontEndMessageReader {
 public:
  // `camera`: of the session, whose size images must have; null: the session has not begun, and only a begin may come.
  FrontEndMessage read(std::span<const std::uint8_t> bytes, const StereoCamera* camera);

 private:
  ImageCodec codec_;
};

BackEndMessage read_back_end_message(std::span<const std::uint8_t> bytes);

}  // namespace parallax

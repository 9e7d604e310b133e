// What the back end makes of the messages of front ends in other processes: calls of BackEnd, answers, and word of what
// is safe in the database (docs/sessions.md). One message at a time, in the order in which they have come.
//
// A message that is not right is answered with a refusal and changes nothing; the front end that sent it is not
// listened to any more. What BackEnd throws beside InputError goes through. Not thread-safe: the back end's thread
// calls it.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/time.h"
#include "sessions/back_end.h"
#include "sessions/lcm_messages.h"

namespace parallax {

// A message of a front end, as it has come.
struct DeskJob {
  std::int64_t front_end = 0;
  std::int32_t stream = 0;
  std::string message;
  std::vector<std::int64_t> alive;  // front ends that have been heard of late
};
// Messages to a front end, while the stream is the one that the job came by.
struct DeskReply {
  std::int64_t front_end = 0;
  std::int32_t stream = 0;
  std::vector<std::string> messages;
};

// What the desk needs of a back end; tests have one without images.
class DeskBackEnd {
 public:
  virtual ~DeskBackEnd() = default;
  virtual SessionState begin(const SessionStart& start) = 0;
  virtual std::optional<SessionState> resume(const std::string& name, SessionPose* last) = 0;
  virtual BackEndAnswer add(int session, const SessionKeyframe& keyframe) = 0;
  virtual BackEndAnswer add(int session, const SessionWindow& window) = 0;
  virtual void add(const std::vector<SessionTiming>& timings) = 0;
  virtual void end(int session) = 0;
  virtual void save() = 0;
  virtual BackEndView view() = 0;
};

struct SessionDeskOptions {
  int jobs_per_save = 16;                                    // at most so many wait to be safe
  Timestamp save_interval = std::chrono::milliseconds(500);  // and for so long
};

class SessionDesk {
 public:
  // `back_end` outlives it.
  SessionDesk(DeskBackEnd* back_end, const SessionDeskOptions& options = {});

  DeskReply work(const DeskJob& job, Timestamp now);
  // Saves when that is due, and says so to all whom it concerns.
  std::vector<DeskReply> save_if_due(Timestamp now);
  std::vector<DeskReply> save();
  // When save_if_due() has something to do.
  std::optional<Timestamp> save_due() const { return save_due_; }

  // Front ends whose sessions have not ended.
  std::vector<std::int64_t> at_work() const;
  // Since this began.
  int sessions_ended() const { return static_cast<int>(sessions_ended_.size()); }

 private:
  struct FrontEnd {
    std::int32_t stream = 0;
    int session = 0;
    StereoCamera camera;
    std::string name;
    std::int64_t done = 0, saved = 0;
    int in_graph = 0;
    bool refused = false, ended = false;
  };

  std::string begin(const DeskJob& job, const BeginMessage& message, FrontEnd* front_end);
  SessionState find_session(const DeskJob& job, const BeginMessage& message, std::optional<SessionPose>* last);
  const FrontEnd* holder_of(int session, const DeskJob& job) const;
  void detach_others(int session, std::int64_t front_end);
  AnswerMessage answer(const BackEndAnswer& answer, std::int64_t number, FrontEnd* front_end);

  DeskBackEnd* back_end_;
  SessionDeskOptions options_;
  FrontEndMessageReader reader_;
  std::map<std::int64_t, FrontEnd> front_ends_;  // that have a session
  int unsaved_ = 0;
  bool save_now_ = false;
  std::optional<Timestamp> save_due_;
  std::set<int> sessions_begun_, sessions_ended_;
};

}  // namespace parallax

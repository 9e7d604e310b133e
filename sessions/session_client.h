// The front end's end of the protocol between processes (docs/sessions.md): finds the back end, begins its session,
// keeps what it has said until that is safe in the database, and says it again to a back end that has begun anew.
//
// Safe is a message that the back end has saved, and a keyframe only once the graph holds it: a back end that begins
// anew forgets keyframes that no window has followed, so that it asks for their places again.
//
// No thread and no clock of its own: the caller says what time it is (of a steady clock), hands over the datagrams that
// arrive, and calls step() at due(). Not thread-safe.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "sessions/lcm_messages.h"
#include "sessions/reliable_stream.h"

namespace parallax {

struct SessionClientOptions {
  ReliableStreamOptions stream;
  std::string where;                                        // the address, as the user named it: for notices
  Timestamp ask_interval = std::chrono::milliseconds(250);  // for a back end, while there is none
  Timestamp silence = std::chrono::milliseconds(1600);      // after which another back end is listened to
  Timestamp first_notice = std::chrono::seconds(3);
  Timestamp give_up = std::chrono::seconds(30);  // without a back end
  int most_waiting = 64;                         // messages that have not been worked on
  int most_unsafe = 512;                         // messages that have not been saved
};

class SessionClient {
 public:
  // `identity`: random, above 0. Notices are lines for the user.
  SessionClient(std::int64_t identity, const SessionClientOptions& options, SendDatagram send_datagram,
                std::function<void(const std::string&)> notice);

  void begin(const SessionStart& start, bool resume, Timestamp now);
  // The number of the next message; the message of that number, encoded. `keyframe`: its index, or -1.
  std::int64_t next_number() const { return posted_ + 1; }
  void post(std::shared_ptr<const std::string> message, int keyframe, Timestamp now);
  // The last message: once it is saved, no back end is needed any more.
  void post_end(std::shared_ptr<const std::string> message, Timestamp now);

  void receive(std::span<const std::uint8_t> datagram, Timestamp now);
  void step(Timestamp now);
  Timestamp due() const;

  // The answer to begin().
  const std::optional<SessionBeginning>& beginning() const { return beginning_; }
  // There is room for another message.
  bool has_room() const;
  bool all_done() const { return done_ == posted_; }
  bool all_saved() const { return saved_ == posted_; }
  bool is_over() const { return ended_ && all_saved(); }
  std::vector<BackEndAnswer> take_answers() { return std::exchange(answers_, {}); }
  // Why the session cannot go on; empty: it can.
  const std::string& failure() const { return failure_; }
  bool failed_by_input() const { return failed_by_input_; }  // InputError, else RunError

  std::size_t kept() const { return kept_.size(); }
  int times_connected() const { return stream_number_; }

 private:
  struct Kept {
    std::int64_t number = 0;
    int keyframe = -1;
    std::shared_ptr<const std::string> message;
  };

  void receive(const Presence& presence, Timestamp now);
  void connect(std::int64_t back_end, Timestamp now);
  void introduce();
  void take(const BegunMessage& message);
  void take(AnswerMessage message);
  void take(const SavedMessage& message);
  void take(const RefusalMessage& message, Timestamp now);
  void fail(const std::string& why, bool input);
  void tell_once(const std::string& line);

  std::int64_t identity_;
  SessionClientOptions options_;
  SendDatagram send_datagram_;
  std::function<void(const std::string&)> notice_;

  SessionStart start_;
  bool resume_ = false, wanted_ = false, introduced_before_ = false, ended_ = false;
  std::int64_t back_end_ = 0;  // 0: none is known
  std::unique_ptr<ReliableStream> stream_;
  std::int32_t stream_number_ = 0;
  bool begun_here_ = false;  // the back end has answered on this stream
  Timestamp heard_{0}, asked_{0};
  std::optional<Timestamp> introduce_again_, busy_since_;
  std::string told_;

  std::optional<SessionBeginning> beginning_;
  std::deque<Kept> kept_;
  std::int64_t posted_ = 0, done_ = 0, saved_ = 0;
  int in_graph_ = 0;
  std::vector<BackEndAnswer> answers_;
  std::string failure_;
  bool failed_by_input_ = false;
};

}  // namespace parallax

// The back end's end of the protocol between processes (docs/sessions.md): streams with any number of front ends, and
// word to all that it is there. What the messages mean is for sessions/session_desk.h.
//
// Before it runs it makes sure that no other back end does: the one that runs answers; of two that begin at once the
// one with the smaller identity stays.
//
// No thread and no clock of its own: the caller says what time it is (of a steady clock), hands over the datagrams that
// arrive, and calls step() at due(). Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>

#include "sessions/reliable_stream.h"
#include "sessions/session_desk.h"

namespace parallax {

struct SessionServerOptions {
  ReliableStreamOptions stream;
  Timestamp presence_interval = std::chrono::milliseconds(500);
  Timestamp listening = std::chrono::milliseconds(1200);  // for another back end
  Timestamp listening_interval = std::chrono::milliseconds(200);
  Timestamp alive = std::chrono::seconds(5);    // a front end that was heard so lately is there
  Timestamp forget = std::chrono::seconds(60);  // one that was not heard for so long is not
  int most_front_ends = 64;
};

class SessionServer {
 public:
  // `identity`: random, above 0. Notices are lines for the user.
  SessionServer(std::int64_t identity, const SessionServerOptions& options, SendDatagram send_datagram,
                std::function<void(const std::string&)> notice, Timestamp now);

  void receive(std::span<const std::uint8_t> datagram, Timestamp now);
  void step(Timestamp now);
  Timestamp due() const;

  // Nobody else is there: front ends are listened to.
  bool running() const { return running_; }
  // Another back end is there; this one keeps quiet.
  bool yielded() const { return yielded_; }

  // The next message of any front end, in the order in which they were completed as far as that is known.
  std::optional<DeskJob> next_job(Timestamp now);
  void send(const DeskReply& reply, Timestamp now);

  // Has been heard of late.
  bool is_alive(std::int64_t front_end, Timestamp now) const;
  int front_ends() const { return static_cast<int>(front_ends_.size()); }
  // All that was said has arrived, as far as front ends are there to say so.
  bool delivered(Timestamp now) const;

 private:
  struct FrontEnd {
    std::unique_ptr<ReliableStream> stream;
    Timestamp heard{0};
  };

  void receive(const Presence& presence);
  void receive(const Probe& probe, Timestamp now);
  FrontEnd* front_end_of(const StreamAddress& address);
  FrontEnd* welcome(const StreamAddress& address, Timestamp now);
  void tell_once(const std::string& line);
  void be_present() const;

  std::int64_t identity_;
  SessionServerOptions options_;
  SendDatagram send_datagram_;
  std::function<void(const std::string&)> notice_;
  bool running_ = false, yielded_ = false;
  Timestamp began_, last_presence_;
  std::map<std::int64_t, FrontEnd> front_ends_;
  std::int64_t last_served_ = 0;
  std::set<std::string> told_;
};

}  // namespace parallax

// One end of a two-way stream of messages over datagrams that are lost, doubled, late and out of order: what is sent
// arrives once, whole and in order, for as long as both ends live.
//
// A message is cut into pieces of one packet each, so that a lost packet costs no more than itself. Receipts tell what
// has arrived; what was overtaken by enough others, or waits longer than the round trip explains, is sent again. No
// more than a window of pieces is on its way: it grows with what arrives and is halved when nothing does, so that
// receive buffers are not overrun. An end whose messages are not taken holds the other one up.
//
// No thread and no clock of its own: the caller says what time it is (of a steady clock), hands over what arrives, and
// calls step() after that, after send(), and at due(). Not thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "core/time.h"
#include "sessions/stream_datagrams.h"

namespace parallax {

struct ReliableStreamOptions {
  int piece_bytes = 1200;  // with its envelope below the 1500 bytes of an Ethernet packet
  int first_window = 32;   // pieces on their way, at first
  int least_window = 16;
  int most_window = 256;  // some 600 kB in a receive buffer
  int overtaken = 8;      // lost: so many sent later have arrived
  Timestamp least_timeout = std::chrono::milliseconds(50);
  Timestamp first_timeout = std::chrono::milliseconds(300);  // before a round trip has been measured
  Timestamp most_timeout = std::chrono::seconds(1);
  Timestamp receipt_delay = std::chrono::milliseconds(5);
  int pieces_per_receipt = 8;
  Timestamp probe_interval = std::chrono::seconds(1);  // of an end that keeps the stream alive
  std::size_t most_message_bytes = std::size_t{64} << 20;
  std::size_t most_waiting_bytes = std::size_t{16} << 20;  // received and not taken; then no more is taken in

  void validate() const;  // throws InputError naming the field
};

class ReliableStream {
 public:
  // `address` as this end says it. `keeps_alive`: probes the other end when it has nothing to say.
  ReliableStream(const StreamAddress& address, bool keeps_alive, const ReliableStreamOptions& options,
                 SendDatagram send_datagram);

  void send(std::shared_ptr<const std::string> message);
  // The next message that has arrived whole, if any.
  std::optional<std::string> take();

  // Datagrams of this stream that have arrived; the caller has looked at their addresses.
  void receive(Piece piece, Timestamp now);
  void receive(const Receipt& receipt, Timestamp now);
  void receive(const Probe& probe, Timestamp now);
  // Sends what is due.
  void step(Timestamp now);
  // When step() has something to do if nothing arrives.
  Timestamp due() const;

  const StreamAddress& address() const { return address_; }
  bool delivered() const { return unsent_.empty() && on_their_way_.empty(); }
  std::size_t waiting() const { return messages_.size(); }
  // The other end has no such stream any more.
  bool forgotten() const { return forgotten_; }
  // Why the other end cannot be understood; empty: it can.
  const std::string& broken() const { return broken_; }
  std::int64_t pieces_sent() const { return sends_; }

 private:
  struct Message {
    std::shared_ptr<const std::string> bytes;
    std::size_t sent = 0;
  };
  struct Sent {
    std::shared_ptr<const std::string> message;
    std::size_t begin = 0, size = 0;
    Timestamp at{0};
    int times = 0;
    bool arrived = false, lost = false;
  };

  void note_arrival(Sent* sent, Timestamp now, std::optional<Timestamp>* round_trip);
  void find_lost(Timestamp now);
  void send_pieces(Timestamp now);
  void send_piece(std::int64_t number, Sent* sent, Timestamp now);
  void send_receipt();
  void join_pieces();
  bool probes() const;
  Timestamp timeout() const;
  std::int64_t limit() const;

  StreamAddress address_;
  bool keeps_alive_;
  ReliableStreamOptions options_;
  SendDatagram send_datagram_;

  // Sending.
  std::deque<Message> unsent_;
  std::deque<Sent> on_their_way_;  // from piece first_unreceived_ on
  std::int64_t first_unreceived_ = 0, their_limit_ = kMostPiecesAhead;
  std::int64_t sends_ = 0;
  Timestamp newest_arrived_ = Timestamp::min();  // when the last of those that have arrived was sent
  int outstanding_ = 0;                          // on their way, neither arrived nor lost
  double window_ = 0;
  bool measured_ = false, forgotten_ = false;
  Timestamp round_trip_{0}, variation_{0}, least_round_trip_ = Timestamp::max(), last_probe_{0};
  int backed_off_ = 0;

  // Receiving.
  std::map<std::int64_t, Piece> early_;
  std::int64_t next_ = 0, promised_ = 0;
  std::string assembling_;
  bool in_message_ = false;
  std::deque<std::string> messages_;
  std::size_t waiting_bytes_ = 0;
  int unreceipted_ = 0;
  std::optional<Timestamp> receipt_due_;
  std::string broken_;
};

}  // namespace parallax

#include "sessions/reliable_stream.h"

#include <algorithm>
#include <utility>

#include "core/check.h"
#include "core/error.h"

namespace parallax {

void ReliableStreamOptions::validate() const {
  const auto refuse = [](const std::string& name, long long found, const std::string& expected) {
    throw InputError("stream option " + name + ": found " + std::to_string(found) + ", expected " + expected);
  };
  if (piece_bytes < 1 || piece_bytes > kMostPieceBytes)
    refuse("piece_bytes", piece_bytes, "1 to " + std::to_string(kMostPieceBytes));
  if (least_window < 1) refuse("least_window", least_window, "1 or more");
  if (first_window < least_window) refuse("first_window", first_window, "least_window or more");
  if (most_window < first_window || most_window > kMostPiecesAhead)
    refuse("most_window", most_window, "first_window to " + std::to_string(kMostPiecesAhead));
  if (pieces_per_receipt < 1) refuse("pieces_per_receipt", pieces_per_receipt, "1 or more");
  for (const Timestamp t : {least_timeout, first_timeout, most_timeout, receipt_delay, probe_interval})
    if (t.count() <= 0) refuse("timeouts", t.count(), "above 0 ns");
}

ReliableStream::ReliableStream(const StreamAddress& address, bool keeps_alive, const ReliableStreamOptions& options,
                               SendDatagram send_datagram)
    : address_(address),
      keeps_alive_(keeps_alive),
      options_(options),
      send_datagram_(std::move(send_datagram)),
      window_(options.first_window) {
  options_.validate();
}

void ReliableStream::send(std::shared_ptr<const std::string> message) {
  PARALLAX_CHECK(message && !message->empty() && message->size() <= options_.most_message_bytes,
                 "a message without bytes, or of too many");
  unsent_.push_back({std::move(message), 0});
}

std::optional<std::string> ReliableStream::take() {
  if (messages_.empty()) return std::nullopt;
  std::string message = std::move(messages_.front());
  messages_.pop_front();
  waiting_bytes_ -= message.size();
  if (limit() > promised_) receipt_due_ = Timestamp::min();  // the other end may be waiting for this
  return message;
}

std::int64_t ReliableStream::limit() const {
  return waiting_bytes_ < options_.most_waiting_bytes ? next_ + kMostPiecesAhead : next_;
}

void ReliableStream::receive(Piece piece, Timestamp now) {
  if (!broken_.empty()) return;
  ++unreceipted_;
  const bool last = piece.last;
  if (piece.number >= next_ && piece.number < limit() && !early_.contains(piece.number)) {
    const std::int64_t number = piece.number;
    early_.emplace(number, std::move(piece));
    join_pieces();
  }
  if (last || unreceipted_ >= options_.pieces_per_receipt)
    receipt_due_ = now;
  else if (!receipt_due_)
    receipt_due_ = now + options_.receipt_delay;
}

void ReliableStream::join_pieces() {
  for (auto piece = early_.begin(); piece != early_.end() && piece->first == next_; piece = early_.erase(piece)) {
    ++next_;
    if (piece->second.first == in_message_) {
      broken_ = piece->second.first ? "a message that begins within another" : "a message without a beginning";
      return;
    }
    in_message_ = true;
    if (assembling_.size() + piece->second.data.size() > options_.most_message_bytes) {
      broken_ = "a message of more than " + std::to_string(options_.most_message_bytes) + " bytes";
      return;
    }
    assembling_ += piece->second.data;
    if (!piece->second.last) continue;
    waiting_bytes_ += assembling_.size();
    messages_.push_back(std::exchange(assembling_, {}));
    in_message_ = false;
  }
}

void ReliableStream::note_arrival(Sent* sent, Timestamp now, std::optional<Timestamp>* round_trip) {
  if (sent->arrived) return;
  sent->arrived = true;
  if (!sent->lost) --outstanding_;
  // Of several that were sent, the last one cannot have arrived sooner than ever another did.
  const Timestamp since = now - sent->at;
  if (sent->times == 1 || since >= least_round_trip_) newest_arrived_ = std::max(newest_arrived_, sent->at);
  if (sent->times == 1) *round_trip = since;
  window_ = std::min(window_ + 1, static_cast<double>(options_.most_window));
}

void ReliableStream::receive(const Receipt& receipt, Timestamp now) {
  if (receipt.unknown) {
    // Before anything has arrived, that is as it should be.
    if (first_unreceived_ > 0) forgotten_ = true;
    return;
  }
  const std::int64_t end = first_unreceived_ + static_cast<std::int64_t>(on_their_way_.size());
  if (receipt.next > end || receipt.next < first_unreceived_) return;  // of another's making, or overtaken
  std::optional<Timestamp> round_trip;
  const Timestamp before = newest_arrived_;
  for (; first_unreceived_ < receipt.next; ++first_unreceived_) {
    note_arrival(&on_their_way_.front(), now, &round_trip);
    on_their_way_.pop_front();
  }
  for (std::size_t i = 0; i < receipt.later.size() && i + 1 < on_their_way_.size(); ++i)
    if (receipt.later[i]) note_arrival(&on_their_way_[i + 1], now, &round_trip);
  their_limit_ = receipt.limit;
  if (newest_arrived_ > before) backed_off_ = 0;
  if (!round_trip) return;
  least_round_trip_ = std::min(least_round_trip_, *round_trip);
  // Mean and mean deviation with gains of an eighth and a quarter (Jacobson 1988).
  if (!measured_) {
    round_trip_ = *round_trip;
    variation_ = *round_trip / 2;
    measured_ = true;
  } else {
    const Timestamp error = *round_trip - round_trip_;
    round_trip_ += error / 8;
    variation_ += ((error.count() < 0 ? -error : error) - variation_) / 4;
  }
}

void ReliableStream::receive(const Probe&, Timestamp now) { receipt_due_ = now; }

Timestamp ReliableStream::timeout() const {
  const Timestamp plain =
      measured_ ? std::max(options_.least_timeout, round_trip_ + 4 * variation_) : options_.first_timeout;
  return std::min(options_.most_timeout, plain * (1 << std::min(backed_off_, 6)));
}

void ReliableStream::find_lost(Timestamp now) {
  const Timestamp patience = timeout(), out_of_order = std::max(round_trip_ / 4, 2 * variation_);
  bool in_vain = false;
  for (Sent& sent : on_their_way_) {
    if (sent.arrived || sent.lost) continue;
    const bool late = now - sent.at >= patience;
    if (!late && newest_arrived_ <= sent.at + out_of_order) continue;
    sent.lost = true;
    --outstanding_;
    in_vain |= late;
  }
  if (!in_vain) return;
  ++backed_off_;
  window_ = std::max(window_ / 2, static_cast<double>(options_.least_window));
}

void ReliableStream::send_piece(std::int64_t number, Sent* sent, Timestamp now) {
  Piece piece;
  piece.address = address_;
  piece.number = number;
  piece.first = sent->begin == 0;
  piece.last = sent->begin + sent->size == sent->message->size();
  piece.data = sent->message->substr(sent->begin, sent->size);
  sent->at = now;
  ++sends_;
  ++sent->times;
  sent->lost = false;
  ++outstanding_;
  send_datagram_(encode(piece));
}

void ReliableStream::send_pieces(Timestamp now) {
  const int window = static_cast<int>(window_);
  std::int64_t number = first_unreceived_;
  for (Sent& sent : on_their_way_) {
    if (outstanding_ >= window) return;
    if (sent.lost && !sent.arrived && number < their_limit_) send_piece(number, &sent, now);
    ++number;
  }
  while (!unsent_.empty() && outstanding_ < window && number < their_limit_ &&
         on_their_way_.size() < static_cast<std::size_t>(kMostPiecesAhead)) {
    Message& message = unsent_.front();
    Sent& sent = on_their_way_.emplace_back();
    sent.message = message.bytes;
    sent.begin = message.sent;
    sent.size = std::min(message.bytes->size() - message.sent, static_cast<std::size_t>(options_.piece_bytes));
    message.sent += sent.size;
    if (message.sent == message.bytes->size()) unsent_.pop_front();
    send_piece(number++, &sent, now);
  }
}

void ReliableStream::send_receipt() {
  Receipt receipt;
  receipt.address = address_;
  receipt.next = next_;
  receipt.limit = promised_ = limit();
  if (!early_.empty()) {
    receipt.later.resize(static_cast<std::size_t>(early_.rbegin()->first - next_));
    for (const auto& [number, piece] : early_) receipt.later[static_cast<std::size_t>(number - next_ - 1)] = true;
  }
  unreceipted_ = 0;
  receipt_due_.reset();
  send_datagram_(encode(receipt));
}

// Held up by the other end, or to keep the stream alive once it is known there.
bool ReliableStream::probes() const {
  return (outstanding_ == 0 && !delivered()) || (keeps_alive_ && first_unreceived_ > 0);
}

void ReliableStream::step(Timestamp now) {
  if (!broken_.empty()) return;
  if (receipt_due_ && *receipt_due_ <= now) send_receipt();
  find_lost(now);
  send_pieces(now);
  if (probes() && now - last_probe_ >= options_.probe_interval) {
    last_probe_ = now;
    send_datagram_(encode(Probe{address_}));
  }
}

Timestamp ReliableStream::due() const {
  Timestamp out = Timestamp::max();
  if (!broken_.empty()) return out;
  if (receipt_due_) out = std::min(out, *receipt_due_);
  const Timestamp patience = timeout();
  for (const Sent& sent : on_their_way_)
    if (!sent.arrived && !sent.lost) out = std::min(out, sent.at + patience);
  if (probes()) out = std::min(out, last_probe_ + options_.probe_interval);
  return out;
}

}  // namespace parallax

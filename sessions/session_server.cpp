#include "sessions/session_server.h"

#include <algorithm>
#include <utility>

#include "core/check.h"
#include "core/log.h"

namespace parallax {
namespace {

constexpr std::size_t kMostNotices = 20;  // of what strangers send

}  // namespace

SessionServer::SessionServer(std::int64_t identity, const SessionServerOptions& options, SendDatagram send_datagram,
                             std::function<void(const std::string&)> notice, Timestamp now)
    : identity_(identity),
      options_(options),
      send_datagram_(std::move(send_datagram)),
      notice_(std::move(notice)),
      began_(now),
      last_presence_(now - options.presence_interval) {
  PARALLAX_CHECK(identity > 0, "an identity below 1");
  options_.stream.validate();
}

void SessionServer::be_present() const { send_datagram_(encode(Presence{identity_, running_, front_ends()})); }

void SessionServer::tell_once(const std::string& line) {
  if (told_.size() < kMostNotices && told_.insert(line).second && notice_) notice_(line);
}

void SessionServer::receive(std::span<const std::uint8_t> bytes, Timestamp now) {
  if (yielded_) return;
  std::string refused;
  std::optional<Datagram> datagram = decode_datagram(bytes, &refused);
  if (!datagram) {
    log::debug("a datagram was refused: ", refused);
    tell_once(refused);
    return;
  }
  if (const auto* presence = std::get_if<Presence>(&*datagram)) {
    receive(*presence);
  } else if (const auto* probe = std::get_if<Probe>(&*datagram)) {
    if (running_) receive(*probe, now);
  } else if (running_) {
    std::visit(
        [&](auto& d) {
          using Type = std::decay_t<decltype(d)>;
          if constexpr (std::is_same_v<Type, Piece> || std::is_same_v<Type, Receipt>) {
            if (d.address.to != identity_) return;
            FrontEnd* from = front_end_of(d.address);
            if constexpr (std::is_same_v<Type, Piece>)
              if (!from && d.number == 0) from = welcome(d.address, now);
            if (!from) return;
            from->heard = now;
            from->stream->receive(std::move(d), now);
          }
        },
        *datagram);
  }
  step(now);
}

void SessionServer::receive(const Presence& presence) {
  if (presence.back_end == identity_) return;  // its own
  if (running_) {
    if (presence.running)
      tell_once("another back end runs on this address as well");
    else
      be_present();
  } else if (presence.running || presence.back_end < identity_) {
    yielded_ = true;
  }
}

void SessionServer::receive(const Probe& probe, Timestamp now) {
  if (probe.address.to == 0) {
    be_present();
    return;
  }
  if (probe.address.to != identity_) return;
  if (FrontEnd* from = front_end_of(probe.address)) {
    from->heard = now;
    from->stream->receive(probe, now);
    return;
  }
  Receipt receipt;
  receipt.address = {identity_, probe.address.from, probe.address.stream};
  receipt.unknown = true;
  send_datagram_(encode(receipt));
}

SessionServer::FrontEnd* SessionServer::front_end_of(const StreamAddress& address) {
  const auto found = front_ends_.find(address.from);
  if (found == front_ends_.end() || found->second.stream->address().stream != address.stream) return nullptr;
  return &found->second;
}

// A stream that begins: of a front end that is new here, or begins anew. Null when there is no room, or it is an old
// one.
SessionServer::FrontEnd* SessionServer::welcome(const StreamAddress& address, Timestamp now) {
  const auto found = front_ends_.find(address.from);
  if (found != front_ends_.end() && found->second.stream->address().stream > address.stream) return nullptr;
  if (found == front_ends_.end() && front_ends() >= options_.most_front_ends) {
    tell_once("a front end is not listened to: " + std::to_string(front_ends()) + " are there already");
    return nullptr;
  }
  log::debug("front end ", address.from, " begins stream ", address.stream);
  FrontEnd& from = front_ends_[address.from];
  from.stream = std::make_unique<ReliableStream>(StreamAddress{identity_, address.from, address.stream}, false,
                                                 options_.stream, send_datagram_);
  from.heard = now;
  return &from;
}

void SessionServer::step(Timestamp now) {
  if (yielded_) return;
  if (!running_ && now - began_ >= options_.listening) {
    running_ = true;
    last_presence_ = now - options_.presence_interval;
  }
  if (now - last_presence_ >= (running_ ? options_.presence_interval : options_.listening_interval)) {
    last_presence_ = now;
    be_present();
  }
  std::erase_if(front_ends_, [&](const auto& entry) {
    if (now - entry.second.heard < options_.forget) return false;
    log::debug("front end ", entry.first, " has gone");
    return true;
  });
  for (auto& [identity, from] : front_ends_) from.stream->step(now);
}

Timestamp SessionServer::due() const {
  if (yielded_) return Timestamp::max();
  Timestamp out = last_presence_ + (running_ ? options_.presence_interval : options_.listening_interval);
  if (!running_) out = std::min(out, began_ + options_.listening);
  for (const auto& [identity, from] : front_ends_)
    out = std::min({out, from.stream->due(), from.heard + options_.forget});
  return out;
}

std::optional<DeskJob> SessionServer::next_job(Timestamp now) {
  // In turn, beginning behind the one that was served last.
  auto next = front_ends_.upper_bound(last_served_);
  for (std::size_t i = 0; i < front_ends_.size(); ++i, ++next) {
    if (next == front_ends_.end()) next = front_ends_.begin();
    std::optional<std::string> message = next->second.stream->take();
    if (!message) continue;
    last_served_ = next->first;
    DeskJob job{next->first, next->second.stream->address().stream, std::move(*message), {}};
    for (const auto& [identity, from] : front_ends_)
      if (now - from.heard < options_.alive) job.alive.push_back(identity);
    next->second.stream->step(now);
    return job;
  }
  return std::nullopt;
}

void SessionServer::send(const DeskReply& reply, Timestamp now) {
  const auto found = front_ends_.find(reply.front_end);
  if (found == front_ends_.end() || found->second.stream->address().stream != reply.stream) return;
  for (const std::string& message : reply.messages)
    found->second.stream->send(std::make_shared<const std::string>(message));
  found->second.stream->step(now);
}

bool SessionServer::is_alive(std::int64_t front_end, Timestamp now) const {
  const auto found = front_ends_.find(front_end);
  return found != front_ends_.end() && now - found->second.heard < options_.alive;
}

bool SessionServer::delivered(Timestamp now) const {
  return std::all_of(front_ends_.begin(), front_ends_.end(), [&](const auto& entry) {
    return entry.second.stream->delivered() || now - entry.second.heard >= options_.alive;
  });
}

}  // namespace parallax

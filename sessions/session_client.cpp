#include "sessions/session_client.h"

#include <algorithm>
#include <utility>

#include "core/check.h"
#include "core/error.h"
#include "core/log.h"

namespace parallax {

SessionClient::SessionClient(std::int64_t identity, const SessionClientOptions& options, SendDatagram send_datagram,
                             std::function<void(const std::string&)> notice)
    : identity_(identity), options_(options), send_datagram_(std::move(send_datagram)), notice_(std::move(notice)) {
  PARALLAX_CHECK(identity > 0, "an identity below 1");
  options_.stream.validate();
}

void SessionClient::begin(const SessionStart& start, bool resume, Timestamp now) {
  PARALLAX_CHECK(!wanted_, "a session that begins twice");
  start_ = start;
  resume_ = resume;
  wanted_ = true;
  heard_ = now;
  asked_ = now - options_.ask_interval;
  step(now);
}

void SessionClient::post(std::shared_ptr<const std::string> message, int keyframe, Timestamp now) {
  PARALLAX_CHECK(beginning_, "a message before the session has begun");
  kept_.push_back({++posted_, keyframe, message});
  if (begun_here_) stream_->send(std::move(message));
  step(now);
}

void SessionClient::post_end(std::shared_ptr<const std::string> message, Timestamp now) {
  ended_ = true;
  post(std::move(message), -1, now);
}

bool SessionClient::has_room() const {
  return posted_ - done_ < options_.most_waiting && posted_ - saved_ < options_.most_unsafe;
}

void SessionClient::tell_once(const std::string& line) {
  if (line == told_) return;
  told_ = line;
  if (!line.empty() && notice_) notice_(line);
}

void SessionClient::fail(const std::string& why, bool input) {
  if (!failure_.empty()) return;
  failure_ = why;
  failed_by_input_ = input;
}

void SessionClient::receive(std::span<const std::uint8_t> bytes, Timestamp now) {
  if (!failure_.empty() || !wanted_) return;
  std::string refused;
  std::optional<Datagram> datagram = decode_datagram(bytes, &refused);
  if (!datagram) {
    log::debug("a datagram was refused: ", refused);
    if (back_end_ == 0 && refused.find("version") != std::string::npos)
      tell_once(options_.where + ": " + refused + ": another version of the program?");
    return;
  }
  if (const auto* presence = std::get_if<Presence>(&*datagram)) {
    receive(*presence, now);
  } else if (stream_) {
    const StreamAddress expected{back_end_, identity_, stream_number_};
    std::visit(
        [&](auto& d) {
          using Type = std::decay_t<decltype(d)>;
          if constexpr (!std::is_same_v<Type, Presence>) {
            if (d.address != expected) return;
            heard_ = now;
            stream_->receive(std::move(d), now);
          }
        },
        *datagram);
  }
  step(now);
}

void SessionClient::receive(const Presence& presence, Timestamp now) {
  if (!presence.running) return;
  if (presence.back_end == back_end_) {
    heard_ = now;
    return;
  }
  // Another one: only once the one that is known has gone.
  if (is_over()) return;
  if (back_end_ != 0 && now - heard_ < options_.silence) return;
  connect(presence.back_end, now);
}

void SessionClient::connect(std::int64_t back_end, Timestamp now) {
  back_end_ = back_end;
  heard_ = now;
  ++stream_number_;
  log::debug("front end ", identity_, " speaks to back end ", back_end, ", stream ", stream_number_);
  stream_ = std::make_unique<ReliableStream>(StreamAddress{identity_, back_end_, stream_number_}, true, options_.stream,
                                             send_datagram_);
  introduce();
}

void SessionClient::introduce() {
  BeginMessage message;
  message.start = start_;
  if (beginning_) {
    message.start.name = beginning_->state.start.name;
    message.session = beginning_->state.id;
  }
  message.resume = resume_;
  message.again = introduced_before_;
  introduced_before_ = true;
  begun_here_ = false;
  introduce_again_.reset();
  stream_->send(std::make_shared<const std::string>(encode(message)));
}

void SessionClient::step(Timestamp now) {
  if (!failure_.empty() || !wanted_) return;
  if (introduce_again_ && *introduce_again_ <= now) introduce();
  if (stream_ && stream_->forgotten() && !is_over()) connect(back_end_, now);
  if (stream_) stream_->step(now);
  while (stream_) {
    const std::optional<std::string> message = stream_->take();
    if (!message) break;
    try {
      const BackEndMessage read =
          read_back_end_message({reinterpret_cast<const std::uint8_t*>(message->data()), message->size()});
      if (const auto* begun = std::get_if<BegunMessage>(&read)) take(*begun);
      if (const auto* answer = std::get_if<AnswerMessage>(&read)) take(*answer);
      if (const auto* saved = std::get_if<SavedMessage>(&read)) take(*saved);
      if (const auto* refusal = std::get_if<RefusalMessage>(&read)) take(*refusal, now);
    } catch (const InputError& e) {
      fail(options_.where + ": the back end cannot be understood: " + e.what(), false);
    }
    if (!failure_.empty()) return;
    stream_->step(now);
  }
  if (stream_ && !stream_->broken().empty())
    fail(options_.where + ": the back end cannot be understood: found " + stream_->broken(), false);
  if (is_over()) return;
  const Timestamp silent = now - heard_;
  if (silent >= options_.give_up) {
    fail(back_end_ == 0 ? "no back end answers on " + options_.where
                        : "the back end on " + options_.where + " does not answer any more",
         false);
    return;
  }
  if (silent >= options_.first_notice)
    tell_once(back_end_ == 0
                  ? "no back end answers on " + options_.where + "; start one with: parallax backend --lcm " +
                        options_.where + " --database FILE"
                  : "the back end on " + options_.where + " does not answer any more; waiting for it to come back");
  if ((back_end_ == 0 || silent >= options_.silence) && now - asked_ >= options_.ask_interval) {
    asked_ = now;
    send_datagram_(encode(Probe{{identity_, 0, 0}}));
  }
}

Timestamp SessionClient::due() const {
  if (!failure_.empty() || !wanted_) return Timestamp::max();
  if (is_over()) return stream_->due();
  Timestamp out = heard_ + options_.give_up;
  const Timestamp asking = asked_ + options_.ask_interval;
  out = std::min(out, back_end_ == 0 ? asking : std::max(asking, heard_ + options_.silence));
  if (stream_) out = std::min(out, stream_->due());
  if (introduce_again_) out = std::min(out, *introduce_again_);
  return out;
}

void SessionClient::take(const BegunMessage& message) {
  if (begun_here_) return;
  if (beginning_ && message.session != beginning_->state.id) {
    fail(options_.where + ": found session " + std::to_string(message.session) + ", expected " +
             std::to_string(beginning_->state.id) + ": has the back end another database?",
         false);
    return;
  }
  begun_here_ = true;
  tell_once("");
  in_graph_ = message.last ? message.last->key.keyframe + 1 : 0;
  if (!beginning_) {
    SessionBeginning beginning;
    beginning.state.id = message.session;
    beginning.state.start = start_;
    beginning.state.start.name = message.name;
    beginning.state.component = message.component;
    beginning.state.global_from_session = message.global_from_session;
    beginning.state.anchor_covariance = message.anchor_covariance;
    beginning.last = message.last;
    beginning_ = std::move(beginning);
  }
  // What that back end does not have.
  for (const Kept& kept : kept_)
    if (kept.keyframe < 0 || kept.keyframe >= in_graph_) stream_->send(kept.message);
}

void SessionClient::take(AnswerMessage message) {
  if (!begun_here_ || message.number <= done_ || message.number > posted_) return;
  done_ = message.number;
  if (!message.answer) return;
  message.answer->session = beginning_->state.id;
  answers_.push_back(std::move(*message.answer));
}

void SessionClient::take(const SavedMessage& message) {
  if (!begun_here_ || message.number > posted_) return;
  saved_ = std::max(saved_, message.number);
  in_graph_ = std::max(in_graph_, message.in_graph);
  std::erase_if(kept_, [&](const Kept& kept) { return kept.number <= saved_ && kept.keyframe < in_graph_; });
}

void SessionClient::take(const RefusalMessage& message, Timestamp now) {
  if (message.reason == RefusalReason::busy) {
    tell_once(message.text);
    if (now - busy_since_.value_or(now) >= options_.give_up) fail(message.text, false);
    if (!busy_since_) busy_since_ = now;
    introduce_again_ = now + std::chrono::seconds(1);
    return;
  }
  fail(message.text, message.reason == RefusalReason::input);
}

}  // namespace parallax

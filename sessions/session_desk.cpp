#include "sessions/session_desk.h"

#include <algorithm>
#include <utility>

#include "core/error.h"
#include "core/log.h"

namespace parallax {
namespace {

// The front end is told, and may ask again or not.
class Refused : public InputError {
 public:
  Refused(RefusalReason reason, const std::string& text) : InputError(text), reason_(reason) {}
  RefusalReason reason() const { return reason_; }

 private:
  RefusalReason reason_;
};

}  // namespace

SessionDesk::SessionDesk(DeskBackEnd* back_end, const SessionDeskOptions& options)
    : back_end_(back_end), options_(options) {}

// The front end that has this session and has been heard of late, other than the one that asks.
const SessionDesk::FrontEnd* SessionDesk::holder_of(int session, const DeskJob& job) const {
  for (const auto& [identity, front_end] : front_ends_)
    if (front_end.session == session && identity != job.front_end &&
        std::find(job.alive.begin(), job.alive.end(), identity) != job.alive.end())
      return &front_end;
  return nullptr;
}

void SessionDesk::detach_others(int session, std::int64_t front_end) {
  std::erase_if(front_ends_,
                [&](const auto& entry) { return entry.second.session == session && entry.first != front_end; });
}

SessionState SessionDesk::find_session(const DeskJob& job, const BeginMessage& message,
                                       std::optional<SessionPose>* last) {
  // Again: what a back end that has gone may have begun for it, and had no time to answer. It is empty.
  const auto is_its_own = [&](const SessionState& state, bool is_empty) {
    return is_empty && !state.ended && state.start.source == message.start.source &&
           state.start.camera == message.start.camera && state.start.name.starts_with(message.start.name) &&
           !holder_of(state.id, job);
  };
  const bool may_be_there = message.session > 0 || message.resume || message.again;
  const SessionState* there = nullptr;
  BackEndView view;
  if (may_be_there) {
    view = back_end_->view();
    for (const SessionState& state : view.sessions) {
      const bool is_empty = std::none_of(view.poses.begin(), view.poses.end(),
                                         [&](const SessionPose& pose) { return pose.key.session == state.id; });
      const bool is_it = message.session > 0 ? state.id == message.session && state.start.name == message.start.name
                         : message.resume    ? state.start.name == message.start.name
                                             : is_its_own(state, is_empty);
      if (is_it) there = &state;
    }
  }
  if (!there) {
    if (message.session > 0)
      throw Refused(RefusalReason::input, "session " + message.start.name + ": found none of that name and number " +
                                              std::to_string(message.session) + " in the back end's database");
    return back_end_->begin(message.start);
  }
  if (!(there->start.camera == message.start.camera))
    throw Refused(RefusalReason::input,
                  "session " + there->start.name + ": found another camera than it began with, expected the same");
  if (holder_of(there->id, job))
    throw Refused(RefusalReason::busy,
                  "session " + there->start.name + ": another front end is at work on it; waiting");
  SessionPose pose;
  pose.key.keyframe = -1;
  const std::optional<SessionState> state = back_end_->resume(there->start.name, &pose);
  if (!state) throw Refused(RefusalReason::input, "session " + there->start.name + ": it has gone");
  if (pose.key.keyframe >= 0) *last = pose;
  return *state;
}

std::string SessionDesk::begin(const DeskJob& job, const BeginMessage& message, FrontEnd* front_end) {
  std::optional<SessionPose> last;
  const SessionState state = find_session(job, message, &last);
  detach_others(state.id, job.front_end);
  sessions_begun_.insert(state.id);
  *front_end = FrontEnd();
  front_end->stream = job.stream;
  front_end->session = state.id;
  front_end->camera = state.start.camera;
  front_end->name = state.start.name;
  front_end->in_graph = last ? last->key.keyframe + 1 : 0;
  log::debug("front end ", job.front_end, " has session ", state.id, " (", state.start.name, "), stream ", job.stream,
             ", after ", front_end->in_graph, " keyframes");
  BegunMessage answer;
  answer.session = state.id;
  answer.component = state.component;
  answer.name = state.start.name;
  answer.global_from_session = state.global_from_session;
  answer.anchor_covariance = state.anchor_covariance;
  answer.last = last;
  return encode(answer);
}

AnswerMessage SessionDesk::answer(const BackEndAnswer& answer, std::int64_t number, FrontEnd* front_end) {
  front_end->in_graph = answer.in_graph;
  return {number, answer};
}

DeskReply SessionDesk::work(const DeskJob& job, Timestamp now) {
  DeskReply reply{job.front_end, job.stream, {}};
  const auto known = front_ends_.find(job.front_end);
  FrontEnd fresh;
  FrontEnd* front_end = known != front_ends_.end() ? &known->second : &fresh;
  const bool has_session = front_end->session > 0 && front_end->stream == job.stream && !front_end->refused;
  try {
    if (front_end->refused && front_end->stream == job.stream) return reply;
    const FrontEndMessage message =
        reader_.read({reinterpret_cast<const std::uint8_t*>(job.message.data()), job.message.size()},
                     has_session ? &front_end->camera : nullptr);
    std::int64_t number = 0;
    AnswerMessage done;
    if (const auto* m = std::get_if<BeginMessage>(&message)) {
      reply.messages.push_back(begin(job, *m, front_end));
      if (front_end == &fresh) front_ends_[job.front_end] = fresh;
      return reply;
    }
    if (const auto* keyframe = std::get_if<KeyframeMessage>(&message)) {
      number = keyframe->number;
      done = answer(back_end_->add(front_end->session, keyframe->keyframe), number, front_end);
    } else if (const auto* window = std::get_if<WindowMessage>(&message)) {
      number = window->number;
      done = answer(back_end_->add(front_end->session, window->window), number, front_end);
    } else if (const auto* timed = std::get_if<TimingsMessage>(&message)) {
      number = timed->number;
      std::vector<SessionTiming> timings;
      // Of a session before, too: one that went on under another name when tracking failed.
      for (const SessionTiming& timing : timed->timings)
        if (timing.key.keyframe >= 0 && sessions_begun_.contains(timing.key.session)) timings.push_back(timing);
      if (!timings.empty()) back_end_->add(timings);
      done.number = number;
    } else if (const auto* end = std::get_if<EndMessage>(&message)) {
      number = end->number;
      back_end_->end(front_end->session);
      sessions_ended_.insert(front_end->session);
      front_end->ended = true;
      save_now_ = true;
      done.number = number;
    }
    front_end->done = std::max(front_end->done, number);
    ++unsaved_;
    if (!save_due_) save_due_ = now + options_.save_interval;
    reply.messages.push_back(encode(done));
  } catch (const Refused& e) {
    reply.messages.push_back(encode(RefusalMessage{e.reason(), e.what()}));
  } catch (const InputError& e) {
    log::debug("front end ", job.front_end, " is refused: ", e.what());
    reply.messages.push_back(encode(RefusalMessage{RefusalReason::input, e.what()}));
    if (has_session) front_end->refused = true;
  }
  return reply;
}

std::vector<std::int64_t> SessionDesk::at_work() const {
  std::vector<std::int64_t> out;
  for (const auto& [identity, front_end] : front_ends_)
    if (!front_end.ended && !front_end.refused) out.push_back(identity);
  return out;
}

std::vector<DeskReply> SessionDesk::save_if_due(Timestamp now) {
  if (!save_now_ && unsaved_ < options_.jobs_per_save && (!save_due_ || *save_due_ > now)) return {};
  return save();
}

std::vector<DeskReply> SessionDesk::save() {
  std::vector<DeskReply> out;
  back_end_->save();
  unsaved_ = 0;
  save_now_ = false;
  save_due_.reset();
  for (auto& [identity, front_end] : front_ends_) {
    if (front_end.saved == front_end.done) continue;
    front_end.saved = front_end.done;
    out.push_back({identity, front_end.stream, {encode(SavedMessage{front_end.saved, front_end.in_graph})}});
  }
  return out;
}

}  // namespace parallax

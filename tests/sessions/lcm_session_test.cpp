// Front ends and the back end over a simulated network: whatever is lost and whoever is killed, the back end is told
// the same, once and in order.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <functional>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <random>
#include <set>

#include "core/error.h"
#include "sessions/session_client.h"
#include "sessions/session_server.h"
#include "tests/sessions/simulated_network.h"

namespace parallax {
namespace {

using testing::bytes_of;
using testing::NetworkWeather;
using testing::SimulatedNetwork;

constexpr int kWindow = 5;

// What a back end keeps of a session: images as sums.
struct Kept {
  SessionState state;
  std::vector<std::pair<int, double>> keyframes;  // index, sum of pixels
  std::vector<int> constraints;                   // to
  int timings = 0;
  int in_graph() const { return keyframes.empty() ? 0 : 1 + static_cast<int>(constraints.size()); }
  auto told() const { return std::pair(keyframes, constraints); }
};
using Disk = std::map<int, Kept>;

// As BackEnd, without its work: what is not saved is lost with it.
class PaperBackEnd : public DeskBackEnd {
 public:
  explicit PaperBackEnd(Disk* disk) : disk_(disk), now_(*disk) {}

  SessionState begin(const SessionStart& start) override {
    SessionState state;
    state.id = static_cast<int>(now_.size()) + 1;
    state.component = state.id;
    state.start = start;
    const auto taken = [&](const std::string& name) {
      for (const auto& [id, kept] : now_)
        if (kept.state.start.name == name) return true;
      return false;
    };
    for (int n = 2; taken(state.start.name); ++n) state.start.name = start.name + "-" + std::to_string(n);
    now_[state.id].state = state;
    save();
    return state;
  }
  std::optional<SessionState> resume(const std::string& name, SessionPose* last) override {
    for (auto& [id, kept] : now_) {
      if (kept.state.start.name != name) continue;
      kept.keyframes.resize(static_cast<std::size_t>(kept.in_graph()));
      kept.state.ended = false;
      if (!kept.keyframes.empty()) last->key = {id, kept.keyframes.back().first};
      save();
      return kept.state;
    }
    return std::nullopt;
  }
  BackEndAnswer add(int session, const SessionKeyframe& keyframe) override {
    Kept& kept = now_.at(session);
    const int next = static_cast<int>(kept.keyframes.size());
    if (keyframe.index > next) throw InputError("keyframe out of turn");
    if (keyframe.index == next)
      kept.keyframes.emplace_back(next, cv::sum(keyframe.left)[0] + cv::sum(keyframe.right)[0]);
    return answer(session);
  }
  BackEndAnswer add(int session, const SessionWindow& window) override {
    Kept& kept = now_.at(session);
    for (const StereoConstraint& c : window.constraints) {
      if (c.to < kept.in_graph()) continue;
      if (c.to != kept.in_graph() || c.to >= static_cast<int>(kept.keyframes.size()))
        throw InputError("constraint out of turn");
      kept.constraints.push_back(c.to);
    }
    return answer(session);
  }
  void add(const std::vector<SessionTiming>& timings) override {
    for (const SessionTiming& t : timings) ++now_.at(t.key.session).timings;
  }
  void end(int session) override { now_.at(session).state.ended = true; }
  void save() override { *disk_ = now_; }
  BackEndView view() override {
    BackEndView out;
    for (const auto& [id, kept] : now_) {
      out.sessions.push_back(kept.state);
      for (int i = 0; i < kept.in_graph(); ++i) out.poses.emplace_back().key = {id, i};
    }
    return out;
  }

 private:
  BackEndAnswer answer(int session) {
    const Kept& kept = now_.at(session);
    BackEndAnswer out;
    out.session = session;
    out.keyframes = static_cast<int>(kept.keyframes.size());
    out.in_graph = kept.in_graph();
    out.loop = out.keyframes % 7 == 0;
    return out;
  }

  Disk* disk_;
  Disk now_;
};

SessionStart start_named(const std::string& name) {
  SessionStart start;
  start.name = name;
  start.source = "synthetic:paper";
  start.camera = {16, 16, {20, 20}, {8, 8}, 0.1};
  start.frames_per_second = 20;
  return start;
}

SessionKeyframe paper_keyframe(int index) {
  std::mt19937_64 rng(static_cast<std::uint64_t>(index));
  SessionKeyframe out;
  out.index = index;
  out.frame = 4 * index;
  out.left = GreyImage(16, 16);
  out.right = GreyImage(16, 16);
  for (GreyImage* image : {&out.left, &out.right})
    for (std::uint8_t& pixel : *image) pixel = static_cast<std::uint8_t>(rng());
  return out;
}

// A front end that says what it has to say as soon as there is room.
struct PaperFrontEnd {
  PaperFrontEnd(std::int64_t identity, const std::string& name, int keyframes, bool lockstep, bool resume,
                SendDatagram send, Timestamp now)
      : client(identity, options(), std::move(send), [this](const std::string& line) { notices.push_back(line); }),
        keyframes_(keyframes),
        lockstep_(lockstep) {
    client.begin(start_named(name), resume, now);
  }
  static SessionClientOptions options() {
    SessionClientOptions out;
    out.where = "paper";
    return out;
  }
  bool is_done() const { return client.is_over(); }
  void act(Timestamp now) {
    if (!client.beginning() || !client.failure().empty()) return;
    if (next_ < 0) {
      const auto& last = client.beginning()->last;
      first_ = last ? last->key.keyframe : 0;
      constrained_ = next_ = first_;
    }
    for (BackEndAnswer& answer : client.take_answers()) answers.push_back(answer);
    while (!ended_ && client.has_room() && (!lockstep_ || client.all_done())) {
      if (next_ < keyframes_) {
        post(encode(KeyframeMessage{client.next_number(), paper_keyframe(next_)}, &codec_), next_, now);
        ++next_;
        if (next_ % kWindow == 0) send_window(now);
        post(encode(TimingsMessage{client.next_number(),
                                   {{{client.beginning()->state.id, next_ - 1}, SessionModule::window, 1.0, false}}}),
             -1, now);
      } else {
        send_window(now);
        client.post_end(std::make_shared<const std::string>(encode(EndMessage{client.next_number()})), now);
        ended_ = true;
      }
    }
  }
  // Up to the last keyframe but one, as a window that keeps some.
  void send_window(Timestamp now) {
    SessionWindow window;
    const int end = next_ < keyframes_ ? next_ - 1 : next_;
    for (int to = constrained_ + 1; to < end; ++to) {
      StereoConstraint& c = window.constraints.emplace_back();
      c.from = to - 1;
      c.to = to;
      c.covariance = Matrix6d::Identity();
    }
    if (window.constraints.empty()) return;
    constrained_ = end - 1;
    post(encode(WindowMessage{client.next_number(), window}), -1, now);
  }
  void post(std::string message, int keyframe, Timestamp now) {
    client.post(std::make_shared<const std::string>(std::move(message)), keyframe, now);
    most_kept = std::max(most_kept, client.kept());
  }

  SessionClient client;
  std::vector<BackEndAnswer> answers;
  std::vector<std::string> notices;
  std::size_t most_kept = 0;

 private:
  ImageCodec codec_;
  int keyframes_, next_ = -1, first_ = 0, constrained_ = 0;
  bool lockstep_, ended_ = false;
};

// All of it, with one clock.
struct PaperWorld {
  PaperWorld(const NetworkWeather& weather, std::uint64_t seed) : network(weather, seed), rng(seed) {}

  std::int64_t new_identity() { return std::uniform_int_distribution<std::int64_t>(1)(rng); }
  void start_back_end() {
    books = std::make_unique<PaperBackEnd>(&disk);
    desk = std::make_unique<SessionDesk>(books.get());
    server = std::make_unique<SessionServer>(
        new_identity(), SessionServerOptions(), [this](const std::string& d) { network.send(false, d, now); },
        [this](const std::string& line) { notices.push_back(line); }, now);
  }
  void kill_back_end() {
    server.reset();
    desk.reset();
    books.reset();
  }
  PaperFrontEnd* start_front_end(const std::string& name, int keyframes, bool lockstep = false, bool resume = false) {
    front_ends.push_back(std::make_unique<PaperFrontEnd>(
        new_identity(), name, keyframes, lockstep, resume, [this](const std::string& d) { network.send(true, d, now); },
        now));
    return front_ends.back().get();
  }
  bool all_done() const {
    for (const auto& front_end : front_ends)
      if (!front_end->is_done()) return false;
    return true;
  }
  void run(Timestamp until, const std::function<bool()>& is_over) {
    while (now < until && !is_over()) {
      Timestamp next = std::min(until, network.due());
      if (server)
        next = std::min(
            {next, server->due(), job_done.value_or(Timestamp::max()), desk->save_due().value_or(Timestamp::max())});
      for (const auto& front_end : front_ends) next = std::min(next, front_end->client.due());
      now = std::max(now + Timestamp(1), next);
      for (const std::string& d : network.take(false, now))
        for (const auto& front_end : front_ends) front_end->client.receive(bytes_of(d), now);
      for (const std::string& d : network.take(true, now)) {
        if (server) server->receive(bytes_of(d), now);
        if (second) second->receive(bytes_of(d), now);
      }
      for (const auto& front_end : front_ends) {
        front_end->client.step(now);
        front_end->act(now);
      }
      if (server) work();
    }
  }
  // A job takes three milliseconds.
  void work() {
    server->step(now);
    if (job_done && *job_done > now) return;
    job_done.reset();
    if (const std::optional<DeskJob> job = server->next_job(now)) {
      server->send(desk->work(*job, now), now);
      job_done = now + std::chrono::milliseconds(3);
    }
    for (const DeskReply& reply : desk->save_if_due(now)) server->send(reply, now);
  }

  Timestamp now = std::chrono::hours(10);
  SimulatedNetwork network;
  std::mt19937_64 rng;
  Disk disk;
  std::unique_ptr<PaperBackEnd> books;
  std::unique_ptr<SessionDesk> desk;
  std::unique_ptr<SessionServer> server, second;
  std::optional<Timestamp> job_done;
  std::vector<std::unique_ptr<PaperFrontEnd>> front_ends;
  std::vector<std::string> notices;
};

// What a back end that nothing ever happens to is told.
Kept undisturbed(int keyframes) {
  Kept out;
  for (int i = 0; i < keyframes; ++i) {
    const SessionKeyframe k = paper_keyframe(i);
    out.keyframes.emplace_back(i, cv::sum(k.left)[0] + cv::sum(k.right)[0]);
    if (i > 0) out.constraints.push_back(i);
  }
  return out;
}

class LcmSessionWeather : public ::testing::TestWithParam<NetworkWeather> {};

TEST_P(LcmSessionWeather, TheBackEndIsToldAllOnceAndInOrder) {
  PaperWorld world(GetParam(), 3);
  world.start_back_end();
  PaperFrontEnd* a = world.start_front_end("a", 120);
  PaperFrontEnd* b = world.start_front_end("b", 40, true);
  world.run(world.now + std::chrono::minutes(5), [&] { return world.all_done(); });
  ASSERT_TRUE(a->is_done() && b->is_done()) << a->client.failure() << b->client.failure();
  ASSERT_EQ(world.disk.size(), 2u);
  const int of_a = a->client.beginning()->state.id, of_b = b->client.beginning()->state.id;
  EXPECT_EQ(world.disk.at(of_a).told(), undisturbed(120).told());
  EXPECT_EQ(world.disk.at(of_b).told(), undisturbed(40).told());
  EXPECT_EQ(world.disk.at(of_a).timings, 120);
  EXPECT_TRUE(world.disk.at(of_a).state.ended && world.disk.at(of_b).state.ended);
  // Every keyframe and window was answered, in order.
  ASSERT_EQ(b->answers.size(), 48u);
  int keyframes = 0, loops = 0;
  for (const BackEndAnswer& answer : b->answers) {
    EXPECT_GE(answer.keyframes, keyframes);
    keyframes = answer.keyframes;
    loops += answer.loop;
  }
  EXPECT_EQ(keyframes, 40);
  EXPECT_EQ(loops, 6);  // 35 is a window's end as well
  EXPECT_LT(a->most_kept, 200u) << "what is safe is let go";
  EXPECT_EQ(a->client.kept(), 0u);
}

INSTANTIATE_TEST_SUITE_P(Weathers, LcmSessionWeather,
                         ::testing::Values(testing::kGoodWeather, testing::kRoughWeather, testing::kStormyWeather));

TEST(LcmSession, ABackEndThatIsKilledLosesNothing) {
  int kills = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    PaperWorld world(seed % 2 ? testing::kGoodWeather : testing::kRoughWeather, seed);
    world.start_back_end();
    PaperFrontEnd* a = world.start_front_end("a", 60);
    PaperFrontEnd* b = world.start_front_end("b", 30, true);
    for (int k = 0; k < 3 && !world.all_done(); ++k) {
      const auto life = Timestamp(std::uniform_int_distribution<std::int64_t>(0, 2'500'000'000)(world.rng));
      world.run(world.now + life, [&] { return world.all_done(); });
      if (world.all_done()) break;
      world.kill_back_end();
      ++kills;
      world.run(world.now + std::chrono::milliseconds(700), [] { return false; });
      world.start_back_end();
    }
    world.run(world.now + std::chrono::minutes(3), [&] { return world.all_done(); });
    ASSERT_TRUE(world.all_done()) << seed << ": " << a->client.failure() << b->client.failure();
    ASSERT_EQ(world.disk.size(), 2u) << seed << ": no session is begun twice";
    EXPECT_EQ(world.disk.at(a->client.beginning()->state.id).told(), undisturbed(60).told()) << seed;
    EXPECT_EQ(world.disk.at(b->client.beginning()->state.id).told(), undisturbed(30).told()) << seed;
    for (const auto& [id, kept] : world.disk) EXPECT_TRUE(kept.state.ended);
  }
  EXPECT_GT(kills, 60);
}

TEST(LcmSession, AFrontEndThatIsKilledGoesOnWhereTheGraphEnds) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    PaperWorld world(testing::kRoughWeather, seed);
    world.start_back_end();
    world.start_front_end("a", 60);
    const auto life = Timestamp(std::uniform_int_distribution<std::int64_t>(1'300'000'000, 4'000'000'000)(world.rng));
    world.run(world.now + life, [&] { return world.all_done(); });
    const Disk then = world.disk;
    world.front_ends.clear();
    PaperFrontEnd* again = world.start_front_end("a", 60, false, true);
    world.run(world.now + std::chrono::minutes(1), [&] { return world.all_done(); });
    ASSERT_TRUE(again->is_done()) << seed << ": " << again->client.failure();
    ASSERT_EQ(world.disk.size(), 1u);
    EXPECT_EQ(world.disk.begin()->second.told(), undisturbed(60).told());
    // What was in the graph was not said again.
    if (!then.empty() && again->client.beginning()->last) {
      EXPECT_GE(again->client.beginning()->last->key.keyframe + 1, then.begin()->second.in_graph());
    }
  }
}

TEST(LcmSession, ASessionHasOneFrontEnd) {
  PaperWorld world(testing::kGoodWeather, 1);
  world.start_back_end();
  PaperFrontEnd* first = world.start_front_end("a", 1'000'000, true);
  world.run(world.now + std::chrono::seconds(3), [] { return false; });
  ASSERT_TRUE(first->client.beginning());
  PaperFrontEnd* second = world.start_front_end("a", 20, false, true);
  world.run(world.now + std::chrono::seconds(10), [] { return false; });
  EXPECT_FALSE(second->client.beginning());
  ASSERT_EQ(second->notices.size(), 1u);
  EXPECT_NE(second->notices[0].find("another front end is at work on it"), std::string::npos);
  // A new session of that name is another one.
  PaperFrontEnd* third = world.start_front_end("a", 20);
  world.run(world.now + std::chrono::seconds(5), [&] { return third->is_done(); });
  ASSERT_TRUE(third->is_done());
  EXPECT_EQ(third->client.beginning()->state.start.name, "a-2");
}

TEST(LcmSession, WithoutABackEndItSaysSoAndGivesUpInTheEnd) {
  PaperWorld world(testing::kGoodWeather, 1);
  PaperFrontEnd* a = world.start_front_end("a", 20);
  world.run(world.now + std::chrono::seconds(4), [] { return false; });
  ASSERT_EQ(a->notices.size(), 1u);
  EXPECT_EQ(a->notices[0],
            "no back end answers on paper; start one with: parallax backend --lcm paper --database FILE");
  EXPECT_EQ(a->client.failure(), "");
  world.run(world.now + std::chrono::seconds(27), [] { return false; });
  EXPECT_EQ(a->client.failure(), "no back end answers on paper");
  EXPECT_FALSE(a->client.failed_by_input());
  EXPECT_EQ(a->client.due(), Timestamp::max());
}

TEST(LcmSession, TheSecondBackEndOnAnAddressYields) {
  for (const bool at_once : {true, false}) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      PaperWorld world(testing::kRoughWeather, seed);
      std::vector<std::unique_ptr<SessionServer>> servers;
      std::vector<std::pair<int, std::string>> waves;
      SimulatedNetwork between(testing::kRoughWeather, seed);  // true: to the second
      const auto make = [&](bool first) {
        return std::make_unique<SessionServer>(
            world.new_identity(), SessionServerOptions(),
            [&, first](const std::string& d) { between.send(first, d, world.now); }, nullptr, world.now);
      };
      servers.push_back(make(true));
      const Timestamp began = world.now;
      for (int i = 0; i < 400; ++i) {
        world.now += std::chrono::milliseconds(10);
        if (servers.size() == 1 && (at_once || world.now - began > std::chrono::seconds(2)))
          servers.push_back(make(false));
        for (std::size_t k = 0; k < servers.size(); ++k) {
          for (const std::string& d : between.take(k == 1, world.now)) servers[k]->receive(bytes_of(d), world.now);
          servers[k]->step(world.now);
        }
      }
      EXPECT_NE(servers[0]->yielded(), servers[1]->yielded()) << seed;
      EXPECT_NE(servers[0]->running(), servers[1]->running()) << seed;
      EXPECT_TRUE(at_once || servers[0]->running()) << seed;
    }
  }
}

TEST(LcmSession, StrangersChangeNothing) {
  PaperWorld world(testing::kGoodWeather, 9);
  world.start_back_end();
  world.run(world.now + std::chrono::seconds(2), [] { return false; });
  PaperFrontEnd* a = world.start_front_end("a", 60, true);
  // Bytes as they come, datagrams of the protocol that are cut or have a bit turned, and sound ones that mean nothing.
  const std::vector<std::string> sound{encode(Presence{5, true, 1}), encode(Probe{{5, 0, 0}}), encode(Probe{{5, 6, 7}}),
                                       encode(Piece{{5, 6, 7}, 0, true, true, "nonsense"}),
                                       encode(Receipt{{5, 6, 7}, false, 2, 3, {true}})};
  for (int i = 0; i < 3000 && !a->is_done(); ++i) {
    std::string bytes = sound[world.rng() % sound.size()];
    const auto kind = world.rng() % 3;
    if (kind == 0) bytes.resize(world.rng() % bytes.size());
    if (kind == 1) bytes[world.rng() % bytes.size()] ^= static_cast<char>(1 << world.rng() % 8);
    if (world.server) world.server->receive(bytes_of(bytes), world.now);
    if (kind != 2) a->client.receive(bytes_of(bytes), world.now);
    world.run(world.now + std::chrono::milliseconds(2), [] { return false; });
  }
  // A front end whose messages are none is refused, and said so; its session stays empty.
  for (const std::string& message : {std::string("what?"), encode(EndMessage{1})}) {
    DeskJob job{77, 1, message, {}};
    const DeskReply reply = world.desk->work(job, world.now);
    ASSERT_EQ(reply.messages.size(), 1u);
    EXPECT_TRUE(std::holds_alternative<RefusalMessage>(read_back_end_message(bytes_of(reply.messages[0]))));
  }
  world.run(world.now + std::chrono::seconds(60), [&] { return world.all_done(); });
  ASSERT_TRUE(a->is_done()) << a->client.failure();
  ASSERT_EQ(world.disk.size(), 1u);
  EXPECT_EQ(world.disk.at(1).told(), undisturbed(60).told());
  EXPECT_LE(world.notices.size(), 20u);
}

TEST(LcmSession, AFrontEndThatSaysNonsenseIsRefusedAlone) {
  PaperWorld world(testing::kGoodWeather, 9);
  world.start_back_end();
  PaperFrontEnd* a = world.start_front_end("a", 60, true);
  PaperFrontEnd* b = world.start_front_end("b", 1'000'000, true);
  world.run(world.now + std::chrono::milliseconds(1500), [] { return false; });
  ASSERT_TRUE(b->client.beginning());
  b->post("this is no message", -1, world.now);
  world.run(world.now + std::chrono::seconds(60), [&] { return a->is_done(); });
  EXPECT_TRUE(a->is_done());
  EXPECT_NE(b->client.failure().find("expected one of protocol version 1"), std::string::npos) << b->client.failure();
  EXPECT_TRUE(b->client.failed_by_input());
}

}  // namespace
}  // namespace parallax

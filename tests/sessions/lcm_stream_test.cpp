// Datagrams and reliable streams, on a simulated network.
#include <gtest/gtest.h>

#include <random>

#include "sessions/reliable_stream.h"
#include "tests/sessions/simulated_network.h"

namespace parallax {
namespace {

using testing::bytes_of;
using testing::NetworkWeather;
using testing::SimulatedNetwork;

std::string random_message(std::size_t size, std::mt19937_64* rng) {
  std::string out(size, '\0');
  for (char& c : out) c = static_cast<char>((*rng)());
  return out;
}

// Two ends of a stream, the first keeping it alive.
struct StreamPair {
  StreamPair(const NetworkWeather& weather, std::uint64_t seed, const ReliableStreamOptions& options = {})
      : network(weather, seed),
        front({11, 22, 1}, true, options, [this](const std::string& d) { network.send(true, d, now); }),
        back({22, 11, 1}, false, options, [this](const std::string& d) { network.send(false, d, now); }) {}

  void deliver(ReliableStream* to, bool at_back_end) {
    for (const std::string& bytes : network.take(at_back_end, now)) {
      std::string refused;
      auto datagram = decode_datagram(bytes_of(bytes), &refused);
      ASSERT_TRUE(datagram) << refused;
      if (auto* piece = std::get_if<Piece>(&*datagram)) to->receive(std::move(*piece), now);
      if (auto* receipt = std::get_if<Receipt>(&*datagram)) to->receive(*receipt, now);
      if (auto* probe = std::get_if<Probe>(&*datagram)) to->receive(*probe, now);
    }
    to->step(now);
  }
  // Until nothing is left to be said, or the time is up.
  void run(Timestamp until, bool take = true) {
    front.step(now);
    back.step(now);
    while (now < until && !(front.delivered() && back.delivered() && network.due() == Timestamp::max())) {
      now = std::max(now + Timestamp(1), std::min({network.due(), front.due(), back.due(), until}));
      deliver(&front, false);
      deliver(&back, true);
      if (!take) continue;
      while (auto message = back.take()) at_back.push_back(std::move(*message));
      while (auto message = front.take()) at_front.push_back(std::move(*message));
    }
  }

  Timestamp now = std::chrono::hours(1);
  SimulatedNetwork network;
  ReliableStream front, back;
  std::vector<std::string> at_front, at_back;
};

class LcmStreamWeather : public ::testing::TestWithParam<NetworkWeather> {};

TEST_P(LcmStreamWeather, EverythingArrivesOnceWholeAndInOrder) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    std::mt19937_64 rng(seed);
    std::vector<std::string> there, back;
    StreamPair pair(GetParam(), seed);
    std::size_t bytes = 0;
    for (int i = 0; i < 30; ++i) {
      there.push_back(random_message(i % 3 == 0 ? 150'000 : 1 + rng() % 3000, &rng));
      back.push_back(random_message(1 + rng() % 500, &rng));
      bytes += there.back().size();
      pair.front.send(std::make_shared<const std::string>(there.back()));
      pair.back.send(std::make_shared<const std::string>(back.back()));
    }
    const Timestamp began = pair.now;
    pair.run(pair.now + std::chrono::minutes(5));
    EXPECT_EQ(pair.at_back, there);
    EXPECT_EQ(pair.at_front, back);
    // What is sent twice without need is a small part.
    const double pieces = static_cast<double>(bytes) / 1200;
    EXPECT_LT(static_cast<double>(pair.front.pieces_sent()), pieces * (1.25 + 2.5 * GetParam().loss) + 40);
    RecordProperty("seconds", std::to_string(to_seconds(pair.now - began)));
  }
}

INSTANTIATE_TEST_SUITE_P(Weathers, LcmStreamWeather,
                         ::testing::Values(testing::kGoodWeather, testing::kRoughWeather, testing::kStormyWeather));

TEST(LcmStream, AnEndThatDoesNotTakeHoldsTheOtherUpAndLetsItGoOn) {
  ReliableStreamOptions options;
  options.most_waiting_bytes = 100'000;
  StreamPair pair(testing::kRoughWeather, 5, options);
  std::mt19937_64 rng(1);
  std::vector<std::string> there;
  for (int i = 0; i < 100; ++i) {
    there.push_back(random_message(20'000, &rng));
    pair.front.send(std::make_shared<const std::string>(there.back()));
  }
  pair.run(pair.now + std::chrono::seconds(20), false);
  EXPECT_FALSE(pair.front.delivered());
  EXPECT_LT(pair.back.waiting() * 20'000, options.most_waiting_bytes + kMostPiecesAhead * 1200u);
  const std::int64_t sent = pair.front.pieces_sent();
  pair.run(pair.now + std::chrono::seconds(20), false);
  EXPECT_LE(pair.front.pieces_sent(), sent + 20) << "it must wait quietly";
  while (auto message = pair.back.take()) pair.at_back.push_back(std::move(*message));
  pair.run(pair.now + std::chrono::minutes(5));
  EXPECT_EQ(pair.at_back, there);
}

TEST(LcmStream, MessagesOutOfTheirBoundsBreakItAndNothingElse) {
  ReliableStreamOptions options;
  options.most_message_bytes = 5000;
  const auto nowhere = [](const std::string&) {};
  Timestamp now = std::chrono::hours(1);
  ReliableStream long_message({2, 1, 1}, false, options, nowhere), no_beginning({2, 1, 1}, false, options, nowhere);
  for (int i = 0; i < 10; ++i) long_message.receive(Piece{{1, 2, 1}, i, i == 0, false, std::string(1000, 'a')}, now);
  EXPECT_NE(long_message.broken().find("5000 bytes"), std::string::npos);
  no_beginning.receive(Piece{{1, 2, 1}, 0, false, true, "a"}, now);
  EXPECT_EQ(no_beginning.broken(), "a message without a beginning");
  no_beginning.step(now);
  EXPECT_EQ(no_beginning.take(), std::nullopt);
  // Receipts of what was never sent, and pieces far ahead, change nothing.
  ReliableStream stream({2, 1, 1}, false, options, nowhere);
  stream.send(std::make_shared<const std::string>(2000, 'b'));
  stream.step(now);
  stream.receive(Receipt{{1, 2, 1}, false, 3, 400, {}}, now);
  EXPECT_FALSE(stream.delivered());
  stream.receive(Piece{{1, 2, 1}, kMostPiecesAhead, true, true, "far"}, now);
  stream.receive(Piece{{1, 2, 1}, 0, true, true, "near"}, now);
  EXPECT_EQ(stream.take(), "near");
  EXPECT_EQ(stream.take(), std::nullopt);
  stream.receive(Receipt{{1, 2, 1}, false, 2, 400, {}}, now);
  EXPECT_TRUE(stream.delivered());
}

TEST(LcmDatagram, ComesBackAsItWas) {
  std::string refused;
  const auto again = [&](const std::string& bytes) { return decode_datagram(bytes_of(bytes), &refused); };
  const StreamAddress address{1234567890123456789, 987654321987654321, 77};
  const auto presence = std::get<Presence>(*again(encode(Presence{address.from, true, 3})));
  EXPECT_EQ(presence.back_end, address.from);
  EXPECT_TRUE(presence.running);
  EXPECT_EQ(presence.front_ends, 3);
  EXPECT_EQ(std::get<Probe>(*again(encode(Probe{address}))).address, address);
  const auto piece = std::get<Piece>(*again(encode(Piece{address, 5000000000, true, false, "some data"})));
  EXPECT_EQ(piece.address, address);
  EXPECT_EQ(piece.number, 5000000000);
  EXPECT_TRUE(piece.first && !piece.last);
  EXPECT_EQ(piece.data, "some data");
  const std::vector<bool> later{true, false, true, true, false, false, false, true, false, true};
  const auto receipt = std::get<Receipt>(*again(encode(Receipt{address, true, 9, 500, later})));
  EXPECT_EQ(receipt.next, 9);
  EXPECT_EQ(receipt.limit, 500);
  EXPECT_TRUE(receipt.unknown);
  ASSERT_EQ(receipt.later.size(), 16u);
  EXPECT_TRUE(std::equal(later.begin(), later.end(), receipt.later.begin()));
  EXPECT_LT(encode(Piece{address, 1, true, true, std::string(1200, 'x')}).size(), 1400u) << "one packet";
}

TEST(LcmDatagram, DamageIsRefusedWithAReason) {
  const std::string good = encode(Piece{{1, 2, 3}, 4, true, true, std::string(100, 'x')});
  const auto refusal = [](std::string bytes) {
    std::string refused;
    return decode_datagram(bytes_of(bytes), &refused) ? std::string() : refused;
  };
  for (std::size_t size = 0; size < good.size(); ++size) EXPECT_NE(refusal(good.substr(0, size)), "") << size;
  EXPECT_NE(refusal(good + '\0'), "");
  int passed = 0;
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x80);
    passed += refusal(bad).empty();
  }
  EXPECT_LE(passed, 3 * 8 + 1 + 4) << "only addresses and the flags can change and still be a piece";
  std::string later = good;
  later[11] = 2;
  EXPECT_EQ(refusal(later), "piece datagram: found version 2, expected 1");
  std::string endless = good;
  endless[12] = 0x7f;
  EXPECT_NE(refusal(endless).find("lengths"), std::string::npos);
  EXPECT_NE(refusal(encode(Piece{{0, 2, 3}, 4, true, true, "x"})), "");
  EXPECT_NE(refusal(encode(Piece{{1, 2, 3}, 4, true, true, ""})), "");
  EXPECT_NE(refusal(encode(Receipt{{1, 2, 3}, false, 9, 8, {}})), "");
  EXPECT_NE(refusal(encode(Presence{-1, true, 0})), "");
}

}  // namespace
}  // namespace parallax

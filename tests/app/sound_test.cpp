// Sounds played into memory: that they are heard, from where, and how loud; and the player without a device.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

#include "app/asset_folder.h"
#include "app/sound_bank.h"
#include "app/sound_mixer.h"
#include "app/sound_player.h"
#include "core/error.h"
#include "tests/support/process.h"

namespace parallax {
namespace {

const std::string kFolder = std::string(PARALLAX_SOURCE_DIR) + "/assets/sounds";
constexpr int kRate = 44100;

// Before any test: the device is the one that plays into nothing, so that this passes where there is none.
const bool kNoDevice = setenv("ALSOFT_DRIVERS", "null", 1) == 0;

const SoundBank& sounds() {
  static const SoundBank bank = load_sounds(kFolder);
  return bank;
}

struct Energy {
  double left = 0, right = 0;
  double both() const { return left + right; }
};

Energy energy(const std::vector<float>& samples) {
  Energy out;
  for (std::size_t i = 0; i + 1 < samples.size(); i += 2) {
    out.left += static_cast<double>(samples[i]) * samples[i];
    out.right += static_cast<double>(samples[i + 1]) * samples[i + 1];
  }
  return out;
}

class Mixer : public ::testing::Test {
 protected:
  void SetUp() override {
    quieten_sound_libraries();
    std::string why_not;
    mixer_ = SoundMixer::in_memory(sounds(), kRate, &why_not);
    if (mixer_ == nullptr) GTEST_SKIP() << why_not;
  }
  Energy heard(const GameSound& cue) {
    mixer_->stop_all();
    (void)mixer_->render(kRate / 10);
    mixer_->play(cue);
    return energy(mixer_->render(kRate / 2));
  }
  std::unique_ptr<SoundMixer> mixer_;
};

TEST(Sounds, AreAllThereShortAndWithoutClicks) {
  const std::set<std::string> wanted{"fire",      "hit",  "critter_dies", "player_hurt", "pickup",    "wave_begins",
                                     "game_over", "jump", "spit",         "sizzle",      "spark",     "roll",
                                     "knock",     "coin", "goal",         "click",       "countdown", "resume"};
  std::set<std::string> found;
  std::size_t bytes = 0;
  for (const auto& [name, clip] : sounds()) {
    found.insert(name);
    bytes += 2 * clip.samples.size();
    EXPECT_EQ(clip.rate_hz, 22050) << name;
    EXPECT_LE(clip.samples.size(), 2u * 22050) << name;
    int loudest = 0;
    double mean = 0;
    for (const std::int16_t s : clip.samples) {
      loudest = std::max(loudest, std::abs(static_cast<int>(s)));
      mean += s;
    }
    mean /= static_cast<double>(clip.samples.size());
    EXPECT_GT(loudest, 5000) << name;
    EXPECT_LT(loudest, 30000) << name << " is close to clipping";
    EXPECT_LT(std::abs(mean), 200) << name << " is off its middle";
    // No step at the ends; the one that is repeated has none where it meets itself either.
    EXPECT_LT(std::abs(static_cast<int>(clip.samples.front())), 1500) << name;
    EXPECT_LT(std::abs(static_cast<int>(clip.samples.back())), 1500) << name;
    if (name != "roll") {
      EXPECT_EQ(clip.samples.back(), 0) << name;
    }
  }
  EXPECT_EQ(found, wanted);
  EXPECT_LT(bytes, 600'000u);
}

TEST(Sounds, AreWhatTheScriptMakes) {
  const testing::ScratchFolder scratch;
  const auto made =
      testing::run_process(std::string(PARALLAX_SOURCE_DIR) + "/scripts/make-sounds", {scratch.path().string()});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  for (const auto& [name, clip] : sounds()) {
    EXPECT_TRUE(testing::read_all(scratch.file(name + ".wav")) == testing::read_all(kFolder + "/" + name + ".wav"))
        << name << ".wav: run scripts/make-sounds again";
  }
}

TEST(Sounds, AFileThatIsNoneIsNamed) {
  const testing::ScratchFolder scratch;
  const std::string path = scratch.write("broken.wav", "RIFF....WAVE and nothing else");
  try {
    load_sounds(scratch.path().string());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).rfind(path + ": found", 0), 0u) << error.what();
  }
  EXPECT_THROW(load_sounds(scratch.file("absent")), InputError);
}

TEST_F(Mixer, IsSilentUntilACueIsPlayed) {
  EXPECT_EQ(energy(mixer_->render(kRate / 5)).both(), 0);
  EXPECT_GT(heard({"goal", 1, 1, {}}).both(), 10);
  EXPECT_EQ(heard({"no_such_sound", 1, 1, {}}).both(), 0);
  EXPECT_EQ(heard({"goal", std::nanf(""), 1, {}}).both(), 0);
  EXPECT_EQ(heard({"goal", 0, 1, {}}).both(), 0);
}

TEST_F(Mixer, VolumesScaleWhatIsHeard) {
  const double loud = heard({"goal", 1, 1, {}}).both();
  EXPECT_NEAR(heard({"goal", 0.5f, 1, {}}).both() / loud, 0.25, 0.01);
  mixer_->set_volume(0.5);
  EXPECT_NEAR(heard({"goal", 1, 1, {}}).both() / loud, 1.0 / 16, 0.005);
  mixer_->set_volume(0);
  EXPECT_LT(heard({"goal", 1, 1, {}}).both(), 1e-6 * loud);
  mixer_->set_volume(7);
  EXPECT_NEAR(heard({"goal", 1, 1, {}}).both() / loud, 1, 0.01);
}

TEST_F(Mixer, AHigherPitchIsOverSooner) {
  mixer_->play({"goal", 1, 1, {}});
  (void)mixer_->render(kRate);
  EXPECT_EQ(mixer_->voices_playing(), 1u);
  mixer_->stop_all();
  mixer_->play({"goal", 1, 2, {}});
  (void)mixer_->render(kRate);
  EXPECT_EQ(mixer_->voices_playing(), 0u);
}

TEST_F(Mixer, ACueIsHeardFromWhereItIs) {
  // Straight above the table, the top of the image towards the plane's +y: x to the right.
  Eigen::Matrix3d turn;
  turn << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  SoundListener listener;
  listener.camera_from_plane = RigidTransform(turn, Eigen::Vector3d(0, 0, 0.5));
  listener.radius_m = 0.2;
  mixer_->set_listener(listener);
  const Energy left = heard({"coin", 1, 1, Eigen::Vector3d(-0.2, 0, 0)});
  const Energy middle = heard({"coin", 1, 1, Eigen::Vector3d(0, 0, 0)});
  const Energy right = heard({"coin", 1, 1, Eigen::Vector3d(0.2, 0, 0)});
  EXPECT_GT(left.left, 2 * left.right);
  EXPECT_GT(right.right, 2 * right.left);
  EXPECT_NEAR(middle.left / middle.right, 1, 0.01);
  EXPECT_NEAR(left.left / right.right, 1, 0.01);
  // Farther away is softer; the same field in other metres sounds the same.
  listener.camera_from_plane = RigidTransform(turn, Eigen::Vector3d(0, 0, 1.5));
  mixer_->set_listener(listener);
  EXPECT_LT(heard({"coin", 1, 1, Eigen::Vector3d(0, 0, 0)}).both(), 0.7 * middle.both());
  listener.camera_from_plane = RigidTransform(turn, Eigen::Vector3d(0, 0, 5));
  listener.radius_m = 2;
  mixer_->set_listener(listener);
  const Energy large = heard({"coin", 1, 1, Eigen::Vector3d(2, 0, 0)});
  EXPECT_NEAR(large.right / right.right, 1, 0.01);
}

TEST_F(Mixer, VoicesAreBounded) {
  for (int i = 0; i < 20; ++i) mixer_->play({"goal", 0.1f, 1, {}});
  (void)mixer_->render(512);
  EXPECT_EQ(mixer_->voices_playing(), SoundMixer::kVoicesOfOneSound);
  for (int i = 0; i < 500; ++i) {
    for (const auto& [name, clip] : sounds()) mixer_->play({name, 0.05f, 1, {}});
    (void)mixer_->render(64);
    ASSERT_LE(mixer_->voices_playing(), SoundMixer::kVoices);
  }
}

TEST(Player, PlaysOnADeviceAndEndsCleanly) {
  SoundPlayer player(kFolder);
  player.set_volume(3);
  EXPECT_EQ(player.volume(), 1);
  player.set_volume(0.25);
  player.set_muted(true);
  EXPECT_EQ(player.volume(), 0.25);
  EXPECT_TRUE(player.muted());
  const SoundStatus status = player.wait_until_ready();
  EXPECT_EQ(status.state, SoundState::playing) << status.reason;
  for (int i = 0; i < 1000; ++i) player.play({{"click", 1, 1, {}}, {"coin", 1, 1, Eigen::Vector3d(0, 0, 0)}});
  player.set_listener({});
  player.stop_all();
}

TEST(Player, IsSilentWithoutFilesAndSaysWhy) {
  SoundPlayer player("no/such/folder");
  const SoundStatus status = player.wait_until_ready();
  EXPECT_EQ(status.state, SoundState::silent);
  EXPECT_NE(status.reason.find("no/such/folder"), std::string::npos);
  player.play({{"click", 1, 1, {}}});
}

TEST(AssetFolder, AreFoundInTheirOrder) {
  const testing::ScratchFolder scratch;
  for (const char* folder : {"named/sounds", "installed/models", "source/models", "source/sounds"})
    std::filesystem::create_directories(scratch.path() / folder);
  const AssetPlaces installed{"", scratch.file("installed"), scratch.file("source")};
  EXPECT_EQ(asset_folder("models", installed), scratch.file("installed/models"));
  EXPECT_EQ(asset_folder("sounds", installed), scratch.file("source/sounds"));
  const AssetPlaces named{scratch.file("named"), installed.installed, installed.source};
  EXPECT_EQ(asset_folder("sounds", named), scratch.file("named/sounds"));
  try {
    asset_folder("models", named);
    FAIL() << "what is named counts alone";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(scratch.file("named/models")), std::string::npos) << error.what();
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
  EXPECT_FALSE(load_sounds(asset_folder("sounds")).empty());
}

}  // namespace
}  // namespace parallax

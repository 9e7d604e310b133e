#include "app/sound_mixer.h"

#include <AL/al.h>
#include <AL/alc.h>
#include <AL/alext.h>
#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <utility>

namespace parallax {
namespace {

// Distances in radii of the field: as loud as made up to here, then fading slowly, as who looks at a table is some
// radii away from all of it.
constexpr float kNear = 2, kFading = 0.7f;
// Things on the table are before the camera, within some thirty degrees: stretched to the sides to tell left from
// right.
constexpr float kStretch = 2;

constexpr float kLowestPitch = 0.25f, kHighestPitch = 4;

void ignore_alsa(const char*, int, const char*, int, const char*, ...) {}

// The entry point that makes a context current on this thread only; null in an OpenAL without it.
PFNALCSETTHREADCONTEXTPROC thread_context() {
  return reinterpret_cast<PFNALCSETTHREADCONTEXTPROC>(alcGetProcAddress(nullptr, "alcSetThreadContext"));
}

bool make_current(ALCcontext* context) {
  if (const auto set = thread_context()) return set(context) == ALC_TRUE;
  return alcMakeContextCurrent(context) == ALC_TRUE;
}

}  // namespace

void quieten_sound_libraries() {
  setenv("ALSOFT_LOGLEVEL", "0", 0);
  // ALSA comes with OpenAL, or not at all.
  using SetHandler = int (*)(void (*)(const char*, int, const char*, int, const char*, ...));
  if (void* const found = dlsym(RTLD_DEFAULT, "snd_lib_error_set_handler")) {
    reinterpret_cast<SetHandler>(found)(ignore_alsa);
  }
}

struct SoundMixer::Implementation {
  struct Voice {
    ALuint source = 0;
    std::uint64_t started = 0;  // counts cues; 0: never used
    std::string name;
    std::optional<Eigen::Vector3d> position_m;
  };

  ALCdevice* device = nullptr;
  ALCcontext* context = nullptr;
  LPALCRENDERSAMPLESSOFT render_samples = nullptr;
  std::map<std::string, ALuint> buffers;
  std::vector<Voice> voices;
  SoundListener listener;
  std::uint64_t cues = 0;

  Implementation() = default;
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;
  ~Implementation() {
    if (context != nullptr) {
      for (const Voice& voice : voices) {
        alSourceStop(voice.source);
        alSourcei(voice.source, AL_BUFFER, 0);
        alDeleteSources(1, &voice.source);
      }
      for (const auto& [name, buffer] : buffers) alDeleteBuffers(1, &buffer);
      make_current(nullptr);
      alcDestroyContext(context);
    }
    if (device != nullptr) alcCloseDevice(device);
  }

  bool prepare(const SoundBank& sounds, const ALCint* attributes, std::string* why_not) {
    context = alcCreateContext(device, attributes);
    if (context == nullptr || !make_current(context)) {
      *why_not = "the sound device does not play";
      return false;
    }
    alGetError();
    alDistanceModel(AL_INVERSE_DISTANCE_CLAMPED);
    for (std::size_t i = 0; i < kVoices; ++i) {
      Voice voice;
      alGenSources(1, &voice.source);
      if (alGetError() != AL_NO_ERROR) break;  // a device with fewer voices
      alSourcei(voice.source, AL_SOURCE_RELATIVE, AL_TRUE);
      alSourcef(voice.source, AL_REFERENCE_DISTANCE, kNear);
      alSourcef(voice.source, AL_ROLLOFF_FACTOR, kFading);
      voices.push_back(std::move(voice));
    }
    for (const auto& [name, clip] : sounds) {
      ALuint buffer = 0;
      alGenBuffers(1, &buffer);
      alBufferData(buffer, AL_FORMAT_MONO16, clip.samples.data(),
                   static_cast<ALsizei>(clip.samples.size() * sizeof(std::int16_t)), clip.rate_hz);
      if (alGetError() == AL_NO_ERROR) buffers[name] = buffer;
    }
    if (voices.empty()) *why_not = "the sound device has no voices";
    return !voices.empty();
  }

  static bool sounds(const Voice& voice) {
    ALint state = AL_STOPPED;
    alGetSourcei(voice.source, AL_SOURCE_STATE, &state);
    return state == AL_PLAYING;
  }

  // From the camera's frame (x right, y down, z ahead) to OpenAL's (x right, y up, z behind).
  void place(const Voice& voice) const {
    Eigen::Vector3f at = Eigen::Vector3f::Zero();
    if (voice.position_m && listener.camera_from_plane && listener.radius_m > 0) {
      const Eigen::Vector3d seen = *listener.camera_from_plane * *voice.position_m / listener.radius_m;
      if (seen.allFinite()) {
        at = {kStretch * static_cast<float>(seen.x()), -static_cast<float>(seen.y()), -static_cast<float>(seen.z())};
      }
    }
    alSource3f(voice.source, AL_POSITION, at.x(), at.y(), at.z());
  }

  // A silent voice; else the oldest. Of a sound that already has its share of voices: the oldest of those.
  Voice& choose(const std::string& name) {
    std::size_t same = 0;
    Voice* oldest_same = nullptr;
    Voice* best = &voices.front();
    bool silent = false;
    for (Voice& voice : voices) {
      const bool playing = sounds(voice);
      if (playing && voice.name == name) {
        ++same;
        if (oldest_same == nullptr || voice.started < oldest_same->started) oldest_same = &voice;
      }
      if (silent) continue;
      if (!playing || voice.started < best->started) best = &voice;
      silent = !playing;
    }
    return same >= kVoicesOfOneSound ? *oldest_same : *best;
  }
};

SoundMixer::SoundMixer(std::unique_ptr<Implementation> implementation) : implementation_(std::move(implementation)) {}
SoundMixer::~SoundMixer() = default;

std::unique_ptr<SoundMixer> SoundMixer::on_device(const SoundBank& sounds, std::string* why_not) {
  auto made = std::make_unique<Implementation>();
  made->device = alcOpenDevice(nullptr);
  if (made->device == nullptr) {
    *why_not = "there is no sound device";
    return nullptr;
  }
  if (!made->prepare(sounds, nullptr, why_not)) return nullptr;
  return std::unique_ptr<SoundMixer>(new SoundMixer(std::move(made)));
}

std::unique_ptr<SoundMixer> SoundMixer::in_memory(const SoundBank& sounds, int rate_hz, std::string* why_not) {
  auto made = std::make_unique<Implementation>();
  const auto open =
      reinterpret_cast<LPALCLOOPBACKOPENDEVICESOFT>(alcGetProcAddress(nullptr, "alcLoopbackOpenDeviceSOFT"));
  made->render_samples = reinterpret_cast<LPALCRENDERSAMPLESSOFT>(alcGetProcAddress(nullptr, "alcRenderSamplesSOFT"));
  if (open != nullptr && made->render_samples != nullptr) made->device = open(nullptr);
  if (made->device == nullptr) {
    *why_not = "this OpenAL does not play into memory";
    return nullptr;
  }
  const std::array<ALCint, 9> attributes{ALC_FORMAT_CHANNELS_SOFT,
                                         ALC_STEREO_SOFT,
                                         ALC_FORMAT_TYPE_SOFT,
                                         ALC_FLOAT_SOFT,
                                         ALC_FREQUENCY,
                                         rate_hz,
                                         ALC_HRTF_SOFT,
                                         ALC_FALSE,
                                         0};
  if (!made->prepare(sounds, attributes.data(), why_not)) return nullptr;
  return std::unique_ptr<SoundMixer>(new SoundMixer(std::move(made)));
}

void SoundMixer::play(const GameSound& cue) {
  const auto found = implementation_->buffers.find(cue.name);
  if (found == implementation_->buffers.end() || !(cue.volume > 0) || !(cue.pitch > 0)) return;
  auto& voice = implementation_->choose(cue.name);
  alSourceStop(voice.source);
  alSourcei(voice.source, AL_BUFFER, static_cast<ALint>(found->second));
  alSourcef(voice.source, AL_GAIN, std::min(cue.volume, 1.0f));
  alSourcef(voice.source, AL_PITCH, std::clamp(cue.pitch, kLowestPitch, kHighestPitch));
  voice.name = cue.name;
  voice.position_m = cue.position_m;
  voice.started = ++implementation_->cues;
  implementation_->place(voice);
  alSourcePlay(voice.source);
}

void SoundMixer::set_listener(const SoundListener& listener) {
  implementation_->listener = listener;
  for (const auto& voice : implementation_->voices) {
    if (voice.position_m) implementation_->place(voice);
  }
}

void SoundMixer::set_volume(double volume) {
  const double share = volume > 0 ? std::min(volume, 1.0) : 0.0;
  alListenerf(AL_GAIN, static_cast<float>(share * share));
}

void SoundMixer::stop_all() {
  for (const auto& voice : implementation_->voices) alSourceStop(voice.source);
}

std::size_t SoundMixer::voices_playing() const {
  const auto& voices = implementation_->voices;
  return static_cast<std::size_t>(std::count_if(voices.begin(), voices.end(), Implementation::sounds));
}

std::vector<float> SoundMixer::render(int samples) {
  if (implementation_->render_samples == nullptr || samples <= 0) return {};
  std::vector<float> out(2 * static_cast<std::size_t>(samples));
  implementation_->render_samples(implementation_->device, out.data(), samples);
  return out;
}

}  // namespace parallax

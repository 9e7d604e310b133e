// What came of a calibration, as a table and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <ostream>

#include "app/calibrate_views.h"
#include "calib/calibration_session.h"
#include "calib/model_selection.h"
#include "calib/projection_uncertainty.h"
#include "calib/stereo_calibration.h"

namespace parallax {

struct CalibrateReport {
  GatheredViews views;
  CalibrationOutcome outcome;
  UncertaintyMap uncertainty;
  CalibrationCoverage coverage;
  CalibrationJudgement judgement;
};

void print_calibration(const CalibrateReport& report, std::ostream& out);
nlohmann::ordered_json calibration_json(const CalibrateReport& report);

void print_stereo(const StereoResult& result, const GatheredPairs& pairs, std::ostream& out);
nlohmann::ordered_json stereo_json(const StereoResult& result, const GatheredPairs& pairs);

}  // namespace parallax

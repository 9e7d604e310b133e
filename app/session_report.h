// A report on sessions: one HTML file that needs nothing else (no network, no script; plots are SVG in it), with Tables
// 1 and 2 of the paper and its figures beside, plots of times as its Fig. 8, 9 and 11, maps as Fig. 10 and 12, and
// every encounter with its provenance. It is well-formed XML as well, so that programs can read it: figures of the
// tables have an id each (t1-SESSION-poses, t2-MODULE-mean...), plots say where their axes are
// (app/session_report_svg.h).
//
// What is not known is said to be not known. Plain functions; one thread.
#pragma once

#include <string>

#include "app/session_report_data.h"

namespace parallax {

std::string session_report_page(const SessionReportData& data);

// Whole or not at all; throws RunError.
void write_session_report(const SessionReportData& data, const std::string& path);

// Of a database: what `parallax sessions report` does. Throws InputError for a file that is none.
void write_session_report(const std::string& database, const std::string& path);

}  // namespace parallax

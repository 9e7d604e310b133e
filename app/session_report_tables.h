// The tables of a report on sessions, as HTML; internal to app/session_report*.
#pragma once

#include <ostream>

#include "app/session_report_data.h"

namespace parallax {

// Table 1: what the sessions are.
void write_sessions_table(const SessionReportData& data, std::ostream& out);
// Table 2: what each module takes.
void write_times_table(const SessionReportData& data, std::ostream& out);
// Every encounter with its provenance: the first 200, those in the graph before the others.
void write_encounters_table(const SessionReportData& data, std::ostream& out);
void write_settings_table(const SessionReportData& data, std::ostream& out);

}  // namespace parallax

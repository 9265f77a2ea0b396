/* What came of a recording. In: the figures of recording.h and of the client. Out: statistics as JSON, and
 * whether anything is missing. */
#ifndef FIRMWARE_SIM_APP_RECORD_RESULT_H
#define FIRMWARE_SIM_APP_RECORD_RESULT_H

#include "firmware_sim/app/recording.h"

/* Writes the statistics as one JSON object; path "-": to standard output. wall_s: how long the recording
 * took. */
int record_write_stats(const char *path, struct scanhead *sh, const struct recording_result *result, double wall_s,
                       struct sh_err *err);

/* SH_OK, or what is missing: frames, pulses, parts of scans. Echoes that the head left out (max_echoes) do
 * not count. */
int record_check_complete(struct scanhead *sh, const struct recording_result *result, struct sh_err *err);

#endif

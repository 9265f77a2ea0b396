/* What came of a recording: its statistics, and whether anything is missing. */
#ifndef FIRMWARE_SIM_APP_RECORD_RESULT_H
#define FIRMWARE_SIM_APP_RECORD_RESULT_H

#include "firmware_sim/app/recording.h"

/* Statistics as one JSON object; path "-": to standard output. wall_s: how long it took. */
int record_write_stats(const char *path, struct scanhead *sh, const struct recording_result *result, double wall_s,
                       struct sh_err *err);

/* 0, or what is missing: frames, pulses, parts of scans. Echoes that the head left out (max_echoes) are none of it. */
int record_check_complete(struct scanhead *sh, const struct recording_result *result, struct sh_err *err);

#endif

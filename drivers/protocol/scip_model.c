/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/scip_model.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

/* clang-format off */
#define HOKUYO     "Hokuyo Automatic Co.,Ltd."
#define HOKUYO_NEW "Hokuyo Automatic Co., Ltd."

/* Sources: SCIP.md. If no source has a text of a model, the model gets the text of the most similar one. */
#define SPEED_IN_WORDS .speed_before = "Initial(", .speed_after = "[rpm])", .at_default = "<-Default setting by user"
#define RANGES_OF_LX   .no_object = 1, .too_near = 4, .no_step = 5
#define SPEED_ALONE    .speed_before = "", .speed_after = "", .at_default = ""
#define STATES_IN_WORDS \
    .mode_idle = "IDLE", .mode_single = "CLASSIC", .mode_streaming = "CLASSIC", \
    .mode_booting = "BOOTING", .mode_fault = "ERROR", \
    .works = "Sensor works well.", .boots = "Sensor is booting.", .has_failed = "Self test failed."
#define STATES_IN_NUMBERS \
    .mode_idle = "000 Idle", .mode_single = "003 Single_scan", .mode_streaming = "004 Multi_scan", \
    .mode_booting = "001 Booting", .mode_fault = "900 Error", \
    .works = "Stable 000 no error.", .boots = "Booting 001 not ready.", .has_failed = "Error 900 self test failed."

enum { LX = SCIP_INTENSITY | SCIP_REBOOT | SCIP_SLEEP };

#define UST(reading) \
    {.name = reading, .vendor = HOKUYO_NEW, .product = reading, .model = reading, .protocol = "SCIP 2.2", \
     .features = LX | SCIP_STATE | SCIP_TIME_US, .bit_rate = 115200, .link = "Ethernet 100 [Mbps]", SPEED_ALONE, \
     .mode_idle = "Measuring by Sensitive Mode", .mode_single = "Measuring by Sensitive Mode", \
     .mode_streaming = "Measuring by Sensitive Mode", .mode_booting = "Booting", .mode_fault = "Error", \
     .works = "sensor is working normally", .boots = "sensor is booting", .has_failed = "sensor failed its self test", \
     RANGES_OF_LX}

static const struct scip_model models[] = {
    {.name = "URG-04LX",
     .vendor = HOKUYO,
     .product = "SOKUIKI Sensor URG-04LX",
     .model = "URG-04LX(" HOKUYO ")",
     .protocol = "SCIP 2.0",
     .features = SCIP_MOTOR_SPEED | SCIP_BIT_RATE | SCIP_SIMULATION | SCIP_TIME_ALONE | SCIP_TIME_HEX,
     .bit_rate = 19200,
     SPEED_IN_WORDS,
     STATES_IN_WORDS,
     .no_object = 0,
     .too_near = 6,
     .no_step = 19},
    {.name = "UTM-30LX",
     .vendor = HOKUYO,
     .product = "SOKUIKI Sensor TOP-URG UTM-30LX",
     .model = "UTM-30LX(" HOKUYO ")",
     .protocol = "SCIP 2.0",
     .features = LX | SCIP_BIT_RATE | SCIP_SIMULATION | SCIP_TIME_HEX | SCIP_FIRST_AT_ONCE,
     .bit_rate = 115200,
     .link = "USB Full Speed",
     SPEED_IN_WORDS,
     STATES_IN_WORDS,
     RANGES_OF_LX},
    {.name = "UTM-30LX-EW",
     .vendor = HOKUYO_NEW,
     .product = "UTM-30LX-EW",
     .model = "UTM-30LX-EW",
     .protocol = "SCIP 2.2",
     .features = LX | SCIP_MULTI_ECHO | SCIP_TIME_HEX | SCIP_STATE,
     .bit_rate = 115200,
     .link = "Ethernet 100 [Mbps]",
     SPEED_ALONE,
     STATES_IN_NUMBERS,
     RANGES_OF_LX},
    UST("UST-10LX"),
    UST("UST-20LX"),
    {.name = NULL,
     .protocol = "SCIP 2.2",
     .features = LX | SCIP_MULTI_ECHO | SCIP_MOTOR_SPEED | SCIP_BIT_RATE | SCIP_SIMULATION | SCIP_TIME_HEX |
                 SCIP_STATE | SCIP_TIME_US,
     .bit_rate = 115200,
     SPEED_ALONE,
     STATES_IN_NUMBERS,
     RANGES_OF_LX},
};
/* clang-format on */

/* Returns whether a firmware has times in microseconds: a UST has them from 4.1 on in 4.x, the older series from 1.1 on
 * in 1.x. */
static int has_time_us(const char *firmware)
{
    int major, minor;
    return sscanf(firmware, "%d.%d", &major, &minor) == 2 && (major == 4 || major == 1) && minor >= 1;
}

uint32_t scip_model_features(const struct scip_model *model, const char *firmware)
{
    return model->features & ~(has_time_us(firmware) ? 0u : (uint32_t)SCIP_TIME_US);
}

const struct scip_model *scip_model_find(const char *model)
{
    const struct scip_model *row = models;
    while (row->name != NULL && strcmp(row->name, model) != 0)
        row++;
    return row;
}

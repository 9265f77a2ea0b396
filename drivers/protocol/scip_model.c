#include "drivers/protocol/scip_model.h"

#include <stddef.h>
#include <string.h>

#define HOKUYO "Hokuyo Automatic Co.,Ltd."

/* Sources: SCIP.md. Texts that no source has for a model are those of its nearest relative there. */
static const struct scip_model models[] = {
    {.name = "URG-04LX",
     .vendor = HOKUYO,
     .product = "SOKUIKI Sensor URG-04LX",
     .model = "URG-04LX(" HOKUYO ")",
     .protocol = "SCIP 2.0",
     .features = SCIP_MOTOR_SPEED | SCIP_BIT_RATE | SCIP_SIMULATION | SCIP_TIME_ALONE | SCIP_TIME_HEX,
     .bit_rate = 19200,
     .speed_before = "Initial(",
     .speed_after = "[rpm])",
     .at_default = "<-Default setting by user",
     .mode_idle = "IDLE",
     .mode_single = "Measuring by Normal Mode",
     .mode_streaming = "Measuring by Normal Mode",
     .works = "Sensor works well.",
     .no_object = 0,
     .too_near = 6,
     .no_step = 19},
    {.name = "UTM-30LX",
     .vendor = HOKUYO,
     .product = "SOKUIKI Sensor TOP-URG UTM-30LX",
     .model = "UTM-30LX(" HOKUYO ")",
     .protocol = "SCIP 2.2",
     .features =
         SCIP_INTENSITY | SCIP_MULTI_ECHO | SCIP_BIT_RATE | SCIP_REBOOT | SCIP_SLEEP | SCIP_SIMULATION | SCIP_TIME_HEX,
     .bit_rate = 115200,
     .link = "USB 2.0",
     .speed_before = "",
     .speed_after = "",
     .at_default = "",
     .mode_idle = "000 Idle",
     .mode_single = "003 Single_scan",
     .mode_streaming = "004 Multi_scan",
     .works = "Stable 000 no error.",
     .no_object = 1,
     .too_near = 4,
     .no_step = 5},
    {.name = "UST-20LX",
     .vendor = HOKUYO,
     .product = "UST-20LX",
     .model = "UST-20LX",
     .protocol = "SCIP 2.2",
     .features = SCIP_INTENSITY | SCIP_REBOOT | SCIP_SLEEP,
     .bit_rate = 115200,
     .link = "Ethernet 100 [Mbps]",
     .speed_before = "",
     .speed_after = "",
     .at_default = "",
     .mode_idle = "Idle",
     .mode_single = "Measuring by Sensitive Mode",
     .mode_streaming = "Measuring by Sensitive Mode",
     .works = "sensor is working normally",
     .no_object = 1,
     .too_near = 4,
     .no_step = 5},
    {.name = NULL,
     .protocol = "SCIP 2.2",
     .features = SCIP_INTENSITY | SCIP_MULTI_ECHO | SCIP_MOTOR_SPEED | SCIP_BIT_RATE | SCIP_REBOOT | SCIP_SLEEP |
                 SCIP_SIMULATION | SCIP_TIME_HEX,
     .bit_rate = 115200,
     .speed_before = "",
     .speed_after = "",
     .at_default = "",
     .mode_idle = "000 Idle",
     .mode_single = "003 Single_scan",
     .mode_streaming = "004 Multi_scan",
     .works = "Stable 000 no error.",
     .no_object = 1,
     .too_near = 4,
     .no_step = 5},
};

const struct scip_model *scip_model_find(const char *model)
{
    const struct scip_model *row = models;
    while (row->name != NULL && strcmp(row->name, model) != 0)
        row++;
    return row;
}

/* The recorders there are; recorder.c makes the one list of them. */
#ifndef DRIVERS_RECORD_RECORDER_LIST_H
#define DRIVERS_RECORD_RECORDER_LIST_H

#include "drivers/record/recorder.h"

extern const struct recorder_ops recorder_ply, recorder_las, recorder_ptx, recorder_e57, recorder_poses,
    recorder_pcapng, recorder_shs;

#endif

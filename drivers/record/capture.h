/* SPDX-License-Identifier: MIT */
/* A capture of the traffic of any protocol: Ethernet frames to a .pcapng.
 *
 * In: frames (drivers/protocol/ethernet.h), each with its time in UTC and its interface. Out: a file that appears whole
 * or not at all (outfile.h). Functions return SH_OK, or SH_EIO and the errors of outfile.h. */
#ifndef DRIVERS_RECORD_CAPTURE_H
#define DRIVERS_RECORD_CAPTURE_H

#include "drivers/record/outfile.h"

struct capture {
    struct outfile file;
    uint32_t n_interfaces;
    uint64_t packets;
};

/* SH_EINPUT also where an earlier capture has left a PATH.part with data, which wants a repair. */
int capture_open(struct capture *capture, const char *path, struct sh_err *err);
/* Adds an interface that frames come from; readers show its name. Interfaces are numbered from 0. */
int capture_add_interface(struct capture *capture, const char *name, const char *comment, struct sh_err *err);
struct capture_frame {
    uint32_t interface;
    int64_t t_ns;
    const uint8_t *bytes;
    size_t len;
    uint64_t lost; /* frames of its interface that the system threw away just before it */
};
int capture_add(struct capture *capture, const struct capture_frame *frame, struct sh_err *err);
/* Adds the statistics of an interface, at the end: how many frames came, and how many the system had no room for. */
int capture_add_statistics(struct capture *capture, uint32_t interface, int64_t t_ns, uint64_t received,
                           uint64_t dropped, struct sh_err *err);
/* To be called each second; does what outfile_save does. */
int capture_save(struct capture *capture, struct sh_err *err);
/* keep 0: leaves no file. Else, if the file can't be completed, what reached the disk stays as PATH.part, for a
 * repair. */
int capture_close(struct capture *capture, int keep, struct sh_err *err);

#endif

/* What every recorder of points follows in a stream: where scans begin, the one frame of coordinates, the head's pose,
 * and which line and which shot of the line a point is of.
 *
 * Points of a moving head come out where they were hit, each by the pose of its own time: in the polar layout in the
 * scene frame, with a pose of the scan that changes nothing; in the geo layout in the CRS, as of a standing head, and
 * the pose is the first anchor's. Those of the polar layout whose pose was lost are left out and counted; those of the
 * geo layout need none.
 *
 * Where a recorder wants attributes and the head sends them, points wait for the frame behind theirs. Without it (it
 * was lost) they come out with the next points, or at the end, with attributes that are not-a-number, and are counted.
 *
 * A recorder passes each frame to track_frame, what waits to track_flush at the end, and gets its points back in
 * batches. One thread per track. */
#ifndef DRIVERS_RECORD_TRACK_H
#define DRIVERS_RECORD_TRACK_H

#include "core/err.h"
#include "drivers/record/station_pose.h"
#include "drivers/host/scanhead.h"

enum { TRACK_BATCH = 256 };

struct track_waiting;

struct track {
    const char *path;     /* for messages; the recorder's */
    int wants_attributes; /* the recorder's */
    /* of the frame that the points at hand are in */
    const struct scanhead *sh;
    struct scanhead_info info;
    struct station_pose pose;
    uint32_t line; /* in the scan, from 0 */
    int64_t t0_ns; /* of the first point, since the scan's start */
    /* of the stream so far */
    uint32_t n_scans;              /* with points */
    uint64_t n_unplaced;           /* points before their descriptor and anchor were seen */
    uint64_t n_without_pose;       /* points of a moving head whose pose was lost */
    uint64_t n_without_attributes; /* echoes whose attributes were lost */
    uint64_t n_attributes_unheld;  /* echoes with attributes that the recorder has no place for */
    double scale_m;                /* of coordinates in the recording: the stream's; coarser where the head moves far */
    struct scanhead_point point[TRACK_BATCH];
    uint32_t row[TRACK_BATCH]; /* of each point: pulses since the line's first, the blind ones included */
    double frame[TRACK_BATCH]; /* of each point of a moving head: frame scalar of the trajectory; NaN: lost */
    int has_attributes;        /* wanted, and sent: */
    struct scanhead_attribute attribute[TRACK_BATCH];
    double gps_s[TRACK_BATCH]; /* scanhead_gps_time of each, as of its own frame; NaN: not known */
    /* inner state */
    int begun, new_scan, have_next_line;
    uint32_t index[TRACK_BATCH]; /* of each point in its frame, where it may wait */
    struct track_waiting *waiting;
    int crs, epsg, geoid, moving, stops;
    uint32_t next_line, last_station;
    uint64_t next_line_pulse0, last_pulse0;
};

struct track_ops {
    /* Points of a new scan will follow; track->info and pose are its. May be NULL. */
    int (*scan)(void *rec, struct sh_err *err);
    /* n points of track->point; may be NULL. In the geo layout they are in the CRS, in the polar layout in the head's
     * frame, the scene frame where the head moves. */
    int (*points)(void *rec, int n, struct sh_err *err);
};

/* SH_EFORMAT when the stream goes to another CRS or kind of heights, to a head that moves or stands, or that sends
 * attributes or does not (where they are wanted), which no recorder's file can hold, or to a station beyond 65535. */
int track_frame(struct track *track, struct scanhead *sh, const struct scanhead_frame *frame,
                const struct track_ops *ops, void *rec, struct sh_err *err);

/* At the end: points that still wait for their attributes. */
int track_flush(struct track *track, const struct track_ops *ops, void *rec, struct sh_err *err);
void track_free(struct track *track);

/* At the end: what could not be placed, or had no attributes. */
void track_tell(const struct track *track, const struct sh_report *report);

/* The CRS of the recording's points: the stream's in the geo layout, the scene frame in the polar one. */
int track_crs(const struct track *track);  /* enum native_crs */
int track_epsg(const struct track *track); /* 0: none */
int track_is_geoid(const struct track *track);

/* SH_EFORMAT for geodetic coordinates, which formats with rigid poses can't hold. */
int track_check_metres(const struct track *track, struct sh_err *err);

#endif

/* SPDX-License-Identifier: MIT */
/* A track follows a stream for every recorder of points: where scans begin, the one coordinate frame, the head's pose,
 * and the line and the shot of each point. Stream frames go in, one by one; points come out in batches.
 *
 * Each point of a moving head is placed by the pose at its own time. In the polar layout these points are in the scene
 * frame, and the scan's pose is the identity. In the geo layout they are in the CRS, as those of a standing head, and
 * the pose is the first anchor's. Points of the polar layout whose pose was lost are left out and counted. Points of
 * the geo layout need no pose.
 *
 * Where a recorder wants attributes or colours and the head sends them, points wait for the frames that follow theirs.
 * Where one of these frames was lost, the points come out with the next ones, or at the end. The points' attributes are
 * then NaN, their colour is grey, and they are counted. Colours that the head does not send are computed here from the
 * points. Where a recorder wants waveforms and the head sends them, points wait until their line ends or other points
 * come: no frame of waveforms says that it is the last one.
 *
 * In a zeroed struct the owner sets path, ops and rec, and colour where it wants another one than the head's. One
 * thread per track. */
#ifndef DRIVERS_RECORD_TRACK_H
#define DRIVERS_RECORD_TRACK_H

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "drivers/record/colour.h"
#include "drivers/record/station_pose.h"
#include "drivers/record/track_phase.h"

enum { TRACK_BATCH = 256 };

/* Points in columns, as scanhead_columns() writes them. */
struct track_points {
    double x[TRACK_BATCH], y[TRACK_BATCH], z[TRACK_BATCH], range_m[TRACK_BATCH], reflectance_db[TRACK_BATCH];
    int64_t t_ns[TRACK_BATCH];
    uint16_t label[TRACK_BATCH];
    uint8_t echo[TRACK_BATCH], echo_count[TRACK_BATCH];
};

/* Columns that a recorder may do without. They are not computed unless the track needs them itself. */
enum track_column { TRACK_RANGE = 1 << 0, TRACK_REFLECTANCE = 1 << 1, TRACK_TIME = 1 << 2, TRACK_LABEL = 1 << 3 };

struct track_waiting;
struct track_waves;

struct track_ops {
    /* Points of a new scan will follow; track->info and pose describe this scan. May be NULL. */
    int (*scan)(void *rec, struct sh_err *err);
    /* n points of track->points. In the geo layout they are in the CRS; in the polar layout in the head's
     * frame, or in the scene frame where the head moves. NULL: no points wanted. */
    int (*points)(void *rec, int n, struct sh_err *err);
    int metres;           /* 1: SH_EFORMAT where points of a scan are in geodetic coordinates */
    int grid;             /* 1: a file of rows and columns: refuses heads that fire beams in turn or along a list */
    int wants_attributes; /* 1: it has a place for amplitude and width */
    int wants_colours;    /* 1: it has a place for a colour */
    int wants_waves;      /* 1: it has a place for waveforms beside a point */
};

/* Points that are not in the recording, or not with all that was sent. */
struct track_missing {
    uint64_t n_unplaced;           /* points before their descriptor and anchor were seen */
    uint64_t n_without_pose;       /* points of a moving head whose pose was lost */
    uint64_t n_empty;              /* shots without echo that no_empty left out */
    uint64_t n_nowhere;            /* echoes whose coordinates are infinite or NaN, of a broken stream */
    uint64_t n_without_attributes; /* echoes whose attributes were lost */
    uint64_t n_attributes_unheld;  /* echoes with attributes that the recorder has no place for */
    uint64_t n_without_colours;    /* echoes whose colour was lost */
    uint64_t n_waves_unheld;       /* windows of waveforms that the recorder has no place for */
    /* The next five count for recorders that want waveforms. */
    uint64_t n_waves_unplaced; /* windows whose points were lost, or which memory had no room for */
    uint64_t n_waves_alone;    /* windows without a point in them */
    uint64_t n_samples_lost;   /* samples that found no room in the head */
    uint64_t n_without_waves;  /* echoes in no window */
    uint64_t n_without_ranges; /* of these, echoes of a moving head on the Earth, whose ranges are not known */
};

/* The place of the stream in its scan; only track.c uses it. */
struct track_state {
    int new_scan, have_next_line;
    int changes; /* settings change with the next descriptor, from change_pulse on */
    uint64_t change_pulse;
    struct track_phase phase;
    uint32_t next_line, last_station, last_scan;
    uint64_t next_line_pulse0, last_pulse0;
    int64_t last_begin_ns; /* device time of pulse 0 of the scan of the last points */
};

struct track {
    /* set by the owner */
    const char *path; /* for messages */
    const struct track_ops *ops;
    void *rec; /* what ops are called with */
    struct colour_choice colour;
    int no_empty;           /* 1: shots without echo are left out and counted */
    unsigned spared;        /* enum track_column: the recorder reads none of these; may change when a scan begins */
    struct scanhead *sh;    /* of the last frame of any kind */
    struct scanhead *named; /* the head that names most labels; heads in one scene have the same labels */
    uint32_t n_named;
    /* of the stream frame that the points at hand are in */
    struct scanhead_info info;
    struct station_pose pose;
    uint32_t line;  /* in the scan, from 0 */
    uint32_t sweep; /* of the pan (of all rings) in the scan, from 0 */
    int64_t t0_ns;  /* of the first point, since the scan's start */
    /* of the stream so far; the members from begun to stops are set by the first points */
    int begun;
    int crs;  /* enum native_crs of the recording's points: the stream's in the geo layout, else local (scene frame) */
    int epsg; /* 0: none */
    int geoid_heights, moving, stops;
    uint32_t n_scans; /* with points */
    struct track_missing missing;
    /* The most lines of a scan, and pulses of a line, that the descriptor allows, for files of rows and columns;
     * UINT32_MAX: no limit. */
    uint32_t max_lines, max_pulses;
    double cast_share;               /* of a line's pulses, 0..1: those in the blind part are not cast */
    struct scanhead_emitter emitter; /* of the last descriptor */
    double scale_m; /* of coordinates in the recording: the stream's; coarser where the head moves far */
    struct track_points points;
    uint32_t row[TRACK_BATCH]; /* of each point: pulses since the line's first, the blind ones included */
    double frame[TRACK_BATCH]; /* of each point of a moving head: frame scalar of the trajectory; NaN: lost */
    int has_attributes;        /* wanted, and sent: */
    struct scanhead_attribute attribute[TRACK_BATCH];
    int has_deviations;            /* sent with the attributes: */
    double deviation[TRACK_BATCH]; /* scanhead_deviations; NaN: lost */
    int has_colours;               /* wanted, and sent or computed here: */
    uint8_t rgb[TRACK_BATCH][3];
    int has_waves;                                 /* wanted, and sent at present: */
    const struct scanhead_wave *wave[TRACK_BATCH]; /* the window that each point lies in; NULL: none. Windows are valid
                                                    * until the next batch */
    double wave_at[TRACK_BATCH];                   /* the point's place in it, in samples from its first one */
    int waited;                /* 1: the batch's points waited, so later frames may have come; gps_s is set then */
    double gps_s[TRACK_BATCH]; /* scanhead_gps_time of each, as of its own frame; NaN: not known */
    /* inner state */
    uint32_t index[TRACK_BATCH]; /* of each point in its frame, where it may wait */
    struct track_waiting *waiting;
    struct track_waves *waves;
    struct track_state state;
};

/* Returns whether a SCAN_START is of the scan of the last points, and comes after them. Nothing begins with it. One
 * that is not later than these points is of another scan with the same start: a recording may be there twice. */
int track_is_late_start(const struct track *track, const struct scanhead_frame *start);
/* Takes a new frame of the stream. SH_EFORMAT if one file can't hold what the stream goes on with: another CRS or
 * kind of heights; a head that begins or ceases to move, to stop on a trajectory, or to send (wanted) attributes,
 * deviations or colours; a station number above 65535; a line of more than 2^32 pulses. SH_EFORMAT also if
 * the points lack the figure that the colours show, or if ops.metres does not allow their CRS. Errors of ops are passed
 * on. SH_ENOMEM. */
int track_frame(struct track *track, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err);

/* For recorders: leaves only points index[0..n-1] of the batch in it; the indices rise. */
void track_pick(struct track *track, const uint16_t *index, int n);
/* Leaves echoes out whose positions are infinite or NaN, as in a broken stream, and with no_empty shots without echo.
 * Both kinds are counted. Returns how many of the n points of the batch are left. The track calls this before it gives
 * points out. A recorder that changes coordinates calls it again. */
int track_leave_out(struct track *track, int n);
/* Writes the times of the n points in seconds, as t_ns / 1e9. */
void track_seconds(const struct track *track, int n, double *to);

/* Returns 1 if the place of an echo is infinite or NaN. The echo is then counted, and the caller leaves it out. */
static inline int track_is_nowhere(struct track *track, double x, double y, double z)
{
    if ((x - x) + (y - y) + (z - z) == 0) return 0; /* a difference is NaN where one of them is not finite */
    track->missing.n_nowhere++;
    return 1;
}

/* Writes the change of the recording's coordinates along a metre of range, for point i of the batch. In the geo layout
 * the point must have a window. Returns 1. Returns 0 in the polar layout, if the point's range is not above 0 or the
 * pose of a moving head is lost. */
int track_beam(const struct track *track, int i, double beam[3]);

/* At the end: gives out the points that still wait. */
int track_flush(struct track *track, struct sh_err *err);
void track_free(struct track *track);

/* Sets *gps_s to the GPS time of the present scan's start, in seconds since 1980-01-06. Returns 1, or 0 where the time
 * is not known (yet). */
int track_start_gps(const struct track *track, double *gps_s);

#endif

/* SPDX-License-Identifier: MIT */
/* The kinds of faults: KIND(enumerator, name in the configuration). Private to fault.h, which makes the enumeration of
 * them, and fault.c, which makes the table of their names. */

/* on the wire: of a frame of the native protocol, or a unit of another (a datagram, a packet, a telegram) */
KIND(FAULT_DROP, "drop")
KIND(FAULT_DUPLICATE, "duplicate") /* n copies more */
KIND(FAULT_REORDER, "reorder")     /* comes after up to n later ones */
KIND(FAULT_DELAY, "delay")         /* it comes for_ms later; none overtakes it */
KIND(FAULT_JITTER, "jitter")       /* the same, by a random time of up to for_ms */
KIND(FAULT_TRUNCATE, "truncate")   /* its last n bytes are missing; n = 0: a random number */
KIND(FAULT_FLIP, "flip")       /* n bits change, at `byte` or anywhere; reseal: its checksums are made right again */
KIND(FAULT_STALL, "stall")     /* nothing is written for for_ms before it */
KIND(FAULT_SPLIT, "split")     /* it goes out in n writes */
KIND(FAULT_MERGE, "merge")     /* it and the next n - 1 go out in one write */
KIND(FAULT_GARBAGE, "garbage") /* n random bytes before it */
/* on the wire: of a reply to a client */
KIND(FAULT_NO_REPLY, "no_reply")
KIND(FAULT_LATE_REPLY, "late_reply")   /* by for_ms; frames overtake it */
KIND(FAULT_WRONG_REPLY, "wrong_reply") /* the reply before it comes instead */
KIND(FAULT_ECHO, "echo")               /* the client's line comes back before its reply */
/* of the link, at a frame: for all its sessions where not said otherwise */
KIND(FAULT_DISCONNECT, "disconnect") /* the session at hand ends before the frame */
KIND(FAULT_UNPLUG, "unplug")         /* the link is not there for for_ms */
KIND(FAULT_CABLE, "cable")         /* nothing comes or goes for for_ms; reset: what was connected is reset after that */
KIND(FAULT_USB_RESET, "usb_reset") /* the bus is reset */
KIND(FAULT_ENDPOINT_STALL, "endpoint_stall") /* the endpoint of the stream is halted, until the host clears it */
KIND(FAULT_SHORT_PACKETS, "short_packets")   /* each of the next n transfers ends early, and goes on in the next */
/* of the link, at a connection (USB: at an enumeration) */
KIND(FAULT_REFUSE, "refuse")                       /* a client is turned away */
KIND(FAULT_SLOW_ENUMERATION, "slow_enumeration")   /* each control request takes for_ms */
KIND(FAULT_DESCRIPTOR_LENGTH, "descriptor_length") /* the configuration says that it is n bytes longer than it is */
/* in the head: these change what is measured, or what the head says of the time and of its state */
KIND(FAULT_SLOW_BOOT, "slow_boot")         /* takes for_ms longer */
KIND(FAULT_POWER_CYCLE, "power_cycle")     /* everything is off for for_ms, and boots again */
KIND(FAULT_SELF_TEST, "self_test")         /* fails at the end of boot */
KIND(FAULT_MIRROR_SLOW, "mirror_slow")     /* turns at `factor` of its speed */
KIND(FAULT_MIRROR_STUCK, "mirror_stuck")   /* stands where it is */
KIND(FAULT_MIRROR_WOBBLE, "mirror_wobble") /* swings about its even turn by deg, at hz; the encoder shows it */
KIND(FAULT_PAN_SLIP, "pan_slip")           /* the head looks deg farther than the pan's encoder says */
KIND(FAULT_LASER_OFF, "laser_off")
KIND(FAULT_WINDOW_SOILED, "window_soiled") /* loss_db on the way there and back; noise grows as the signal fades */
KIND(FAULT_CLOCK_JUMP, "clock_jump")       /* the time of day, by jump_s */
KIND(FAULT_CLOCK_DRIFT, "clock_drift")     /* gains ppm */
KIND(FAULT_CLOCK_STOP, "clock_stop")
KIND(FAULT_PPS_LOST, "pps_lost")
KIND(FAULT_PPS_JITTER, "pps_jitter")           /* the first pulse and every second one after it are late by for_ms */
KIND(FAULT_NMEA_LOST, "nmea_lost")             /* the receiver sends no sentence */
KIND(FAULT_NMEA_LATE, "nmea_late")             /* by for_ms */
KIND(FAULT_NMEA_VOID, "nmea_void")             /* it has no fix */
KIND(FAULT_NMEA_CHECKSUM, "nmea_checksum")     /* its sentences have wrong checksums */
KIND(FAULT_PTP_LOST, "ptp_lost")               /* nothing comes from the master; the clock gains ppm meanwhile */
KIND(FAULT_PTP_NO_SYNC, "ptp_no_sync")         /* the same, but its Announce messages come */
KIND(FAULT_PTP_FAULTY, "ptp_faulty")           /* the port is faulty; the clock gains ppm meanwhile */
KIND(FAULT_PTP_GRANDMASTER, "ptp_grandmaster") /* another one is better; its time is ahead by ns */
KIND(FAULT_PTP_STEP, "ptp_step")               /* the master's time is ahead by ns */
KIND(FAULT_PTP_ASYMMETRY, "ptp_asymmetry")     /* the way from the master is longer than the mean by ns */
KIND(FAULT_PTP_JITTER, "ptp_jitter")           /* of each measurement, up to ns to either side */
KIND(FAULT_LEAP_SECOND, "leap_second")         /* at the end of the minute at hand; no table has it */
KIND(FAULT_COUNTERS_HIGH, "counters_high")     /* counters begin n below their wrap at power-up */
/* the answer of a SICK scanner's time server is: */
KIND(FAULT_NTP_SILENT, "ntp_silent") /* nothing */
KIND(FAULT_NTP_KISS, "ntp_kiss")     /* DENY */
KIND(FAULT_NTP_UNSYNC, "ntp_unsync") /* that it is not synchronised */
KIND(FAULT_NTP_STEP, "ntp_step")     /* a time that is ahead by jump_s */

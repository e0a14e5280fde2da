/* Operations of FMI-LS-BUS 1.0.0 on CAN (low cut): read from, and appended to, the content of a binary variable.
 *
 * An operation is its code, its whole length and its arguments: numbers in little-endian order, without gaps.
 * Source: FMI Layered Standard for Network Communication 1.0.0, Modelica Association, CAN. */
#ifndef NW_OPERATIONS_H
#define NW_OPERATIONS_H

#include <stdint.h>

typedef enum {
  NW_FORMAT_ERROR = 0x01,
  NW_CAN_TRANSMIT = 0x10, NW_CANFD_TRANSMIT = 0x11, NW_CANXL_TRANSMIT = 0x12,
  NW_CONFIRM = 0x20, NW_ARBITRATION_LOST = 0x30, NW_BUS_ERROR = 0x31,
  NW_CONFIGURATION = 0x40, NW_STATUS = 0x41, NW_WAKEUP = 0x42,
} NwCode;

enum { NW_CAN_BAUDRATE = 1, NW_ARBITRATION_BEHAVIOUR = 4 };  /* what a configuration configures */
enum { NW_BUFFER_AND_RETRANSMIT = 1, NW_DISCARD_AND_NOTIFY = 2 };
enum { NW_ERROR_ACTIVE = 1, NW_ERROR_PASSIVE = 2, NW_BUS_OFF = 3 };
enum { NW_CRC_ERROR = 4 };
enum { NW_PRIMARY = 1, NW_SECONDARY = 2 };  /* who found an error first */

enum { NW_HEADER = 8, NW_ROOM = 4096, NW_FRAME_BYTES = 8 };

/* The content of a binary variable; what does not fit any more is not appended. */
typedef struct {
  uint32_t size, overflowed; /* operations that found no room */
  uint8_t data[NW_ROOM];
} NwBuffer;

/* A frame of classical CAN. */
typedef struct {
  uint32_t identifier;
  uint8_t extended, remote, length, pad;
  uint8_t data[NW_FRAME_BYTES];
} NwFrame;

typedef struct {
  uint32_t code, length; /* `length`: of all of it */
  const uint8_t *bytes;  /* from its code on */
} NwOperation;

/* The operation at `*at`, which is moved behind it: 1; at the end 0; -1 where the rest is no operation. */
int nw_next(const uint8_t *data, uint32_t size, uint32_t *at, NwOperation *operation);
/* Arguments; false where the length does not fit. */
int nw_read_transmit(const NwOperation *operation, NwFrame *frame);
/* The next CAN frame at `*at`: true, or false at the end. Bus errors on the way are counted. */
int nw_next_frame(const NwBuffer *received, uint32_t *at, double *bus_errors, NwFrame *frame);
int nw_read_number(const NwOperation *operation, uint32_t at, uint32_t bytes, uint32_t *number);

void nw_put_transmit(NwBuffer *buffer, const NwFrame *frame);
void nw_put_identifier(NwBuffer *buffer, NwCode code, uint32_t identifier); /* confirm, arbitration lost */
void nw_put_bus_error(NwBuffer *buffer, uint32_t identifier, uint8_t error, uint8_t flag, uint8_t is_sender);
void nw_put_baudrate(NwBuffer *buffer, uint32_t bits_per_s);
void nw_put_behaviour(NwBuffer *buffer, uint8_t behaviour);
void nw_put_wakeup(NwBuffer *buffer);
void nw_put_format_error(NwBuffer *buffer, const NwOperation *wrong);

#endif

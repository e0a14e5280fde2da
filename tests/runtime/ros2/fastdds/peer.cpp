// A peer of another DDS: eProsima Fast DDS, which is ROS 2's default.  It takes and sends messages as bytes, so
// that it needs none of our types:
//
//     peer DOMAIN take TOPIC TYPE SECONDS        prints the first message as hexadecimal digits
//     peer DOMAIN send TOPIC TYPE SECONDS HEX    sends it ten times a second
//
// Settings are those of ROS 2 with ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST: UDP on 127.0.0.1, peers asked there.
#include <chrono>
#include <cstdio>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

using namespace eprosima::fastdds::dds;
using namespace eprosima::fastrtps::rtps;
using Bytes = std::vector<unsigned char>;

class Raw : public TopicDataType {
 public:
  explicit Raw(const std::string &name) {
    setName(name.c_str());
    m_typeSize = 1 << 16;
    m_isGetKeyDefined = false;
  }
  bool serialize(void *data, SerializedPayload_t *payload) override {
    const Bytes &bytes = *static_cast<Bytes *>(data);
    payload->encapsulation = CDR_LE;
    payload->length = static_cast<uint32_t>(bytes.size());
    memcpy(payload->data, bytes.data(), bytes.size());
    return true;
  }
  bool deserialize(SerializedPayload_t *payload, void *data) override {
    static_cast<Bytes *>(data)->assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<uint32_t()> getSerializedSizeProvider(void *data) override {
    return [data]() { return static_cast<uint32_t>(static_cast<Bytes *>(data)->size()); };
  }
  void *createData() override { return new Bytes; }
  void deleteData(void *data) override { delete static_cast<Bytes *>(data); }
  bool getKey(void *, InstanceHandle_t *, bool) override { return false; }
};

static DomainParticipant *join(unsigned domain) {
  DomainParticipantQos qos;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.push_back("127.0.0.1");
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  Locator_t local;
  IPLocator::setIPv4(local, "127.0.0.1");
  qos.wire_protocol().builtin.initialPeersList.push_back(local);
  return DomainParticipantFactory::get_instance()->create_participant(domain, qos);
}

static int take(DomainParticipant *participant, Topic *topic, double seconds) {
  Subscriber *subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  DataReaderQos qos = DATAREADER_QOS_DEFAULT;
  qos.reliability().kind = RELIABLE_RELIABILITY_QOS;  // ROS 2's default
  DataReader *reader = subscriber->create_datareader(topic, qos);
  for (double waited = 0; waited < seconds; waited += 0.02) {
    Bytes bytes;
    SampleInfo info;
    if (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK && info.valid_data) {
      for (unsigned char byte : bytes) printf("%02x", byte);
      printf("\n");
      return 0;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return 1;
}

static int send(DomainParticipant *participant, Topic *topic, double seconds, const char *hex) {
  Bytes bytes;
  for (size_t i = 0; hex[i] && hex[i + 1]; i += 2) {
    bytes.push_back(static_cast<unsigned char>(std::stoi(std::string(hex + i, 2), nullptr, 16)));
  }
  Publisher *publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
  DataWriter *writer = publisher->create_datawriter(topic, DATAWRITER_QOS_DEFAULT);
  for (double sent = 0; sent < seconds; sent += 0.1) {
    writer->write(&bytes);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return 0;
}

int main(int count, char **given) {
  if (count < 6) return 2;
  DomainParticipant *participant = join(static_cast<unsigned>(std::stoul(given[1])));
  TypeSupport type(new Raw(given[4]));
  type.register_type(participant);
  Topic *topic = participant->create_topic(given[3], given[4], TOPIC_QOS_DEFAULT);
  const double seconds = std::stod(given[5]);
  return strcmp(given[2], "take") ? send(participant, topic, seconds, given[6]) : take(participant, topic, seconds);
}

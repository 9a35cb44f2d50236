declare module "given:worker" {
  const source: string;
  export default source;
}
declare module "given:tutorial" {
  const chapters: { title: string; html: string; trials: import("./tutorial").Trial[] }[];
  export default chapters;
}
declare module "given:examples" {
  const examples: { name: string; domain: string; problem: string; plan: string; world: string; likelihoods: string }[];
  export default examples;
}

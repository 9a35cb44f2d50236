declare module "given:worker" {
  const source: string;
  export default source;
}
declare module "given:examples" {
  const examples: { name: string; domain: string; problem: string; plan: string; world: string }[];
  export default examples;
}
